// Colour maps as nine colours each on a way through CIE LCh that we chose, joined by straight lines in sRGB.
// SPDX-License-Identifier: MIT
#include "libvkt/render/colormap.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vkt::render {

namespace {

struct Map {
    std::string_view name;
    std::array<Color, 9> colors;
};

// viridis: lightness 14 to 91, hue from violet through green to yellow. ember: black through purple and orange to
// cream. coolwarm: blue to red with a light, neutral middle. bone, heat, tissue: hand-set.
constexpr std::array<Map, 7> maps{{
    {"grey",
     {{{0, 0, 0},
       {.125, .125, .125},
       {.25, .25, .25},
       {.375, .375, .375},
       {.5, .5, .5},
       {.625, .625, .625},
       {.75, .75, .75},
       {.875, .875, .875},
       {1, 1, 1}}}},
    {"bone",
     {{{.05, .05, .08},
       {.16, .16, .22},
       {.28, .29, .36},
       {.40, .42, .49},
       {.52, .55, .60},
       {.64, .68, .71},
       {.77, .80, .81},
       {.89, .91, .91},
       {1, 1, .98}}}},
    {"heat",
     {{{.04, 0, 0},
       {.34, .01, 0},
       {.62, .05, .01},
       {.86, .16, .02},
       {.98, .36, .04},
       {1, .57, .10},
       {1, .76, .26},
       {1, .91, .55},
       {1, 1, .92}}}},
    {"tissue",
     {{{.36, .13, .10},
       {.55, .20, .15},
       {.72, .31, .22},
       {.83, .46, .32},
       {.90, .62, .45},
       {.94, .75, .59},
       {.96, .85, .73},
       {.98, .93, .86},
       {1, .99, .96}}}},
    {"viridis",
     {{{.194, .071, .327},
       {.236, .192, .426},
       {.222, .316, .541},
       {.000, .453, .640},
       {.000, .583, .655},
       {.232, .698, .598},
       {.505, .792, .484},
       {.736, .864, .362},
       {.952, .921, .157}}}},
    {"ember",
     {{{.051, .033, .090},
       {.160, .101, .257},
       {.358, .124, .378},
       {.639, .069, .348},
       {.798, .254, .208},
       {.866, .455, .179},
       {.928, .630, .237},
       {.975, .801, .477},
       {1.00, .963, .875}}}},
    {"coolwarm",
     {{{.000, .322, .725},
       {.448, .555, .881},
       {.692, .738, .963},
       {.838, .855, .971},
       {.916, .894, .891},
       {.986, .830, .803},
       {.985, .692, .644},
       {.898, .485, .427},
       {.719, .193, .169}}}},
}};

} // namespace

std::vector<std::string> colormap_names() {
    return collect(maps, [](Map const& map) { return std::string(map.name); });
}

Color colormap(std::string_view name, double x) {
    std::string_view base = name;
    x = std::clamp(x, 0.0, 1.0);
    constexpr std::string_view reverse = ":reverse";
    if (base.ends_with(reverse)) {
        base.remove_suffix(reverse.size());
        x = 1 - x;
    }
    for (Map const& map : maps) {
        if (map.name != base) continue;
        double const place = 8 * x;
        auto const i = static_cast<std::size_t>(std::min(place, 7.0));
        double const f = place - static_cast<double>(i);
        Color const &a = map.colors[i], &b = map.colors[i + 1];
        return {a.red + f * (b.red - a.red), a.green + f * (b.green - a.green), a.blue + f * (b.blue - a.blue)};
    }
    std::string const near = nearest_name(base, colormap_names());
    throw Error(ErrorKind::usage, text("colour map '", name, "' is not one of ", join(colormap_names(), ", ")),
                near.empty() ? "append :reverse to run one backwards" : text("did you mean '", near, "'?"));
}

double srgb_to_linear(double value) {
    double const v = std::clamp(value, 0.0, 1.0);
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

double linear_to_srgb(double value) {
    double const v = std::clamp(value, 0.0, 1.0);
    return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
}

} // namespace vkt::render
