// Colour maps as colours joined by straight lines in sRGB.
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

/// A colour and where it stands.
struct Stop {
    double at;
    Color color;
};

// Ours, joined by straight lines as all here are. heat, tissue: hand-set. ember: lightness 3 to 97 in CIE LCh, from
// black through purple and orange to cream.
constexpr std::array<Color, 2> grey{{{0, 0, 0}, {1, 1, 1}}};
constexpr std::array<Color, 9> heat{{{.04, 0, 0},
                                     {.34, .01, 0},
                                     {.62, .05, .01},
                                     {.86, .16, .02},
                                     {.98, .36, .04},
                                     {1, .57, .10},
                                     {1, .76, .26},
                                     {1, .91, .55},
                                     {1, 1, .92}}};
constexpr std::array<Color, 9> tissue{{{.36, .13, .10},
                                       {.55, .20, .15},
                                       {.72, .31, .22},
                                       {.83, .46, .32},
                                       {.90, .62, .45},
                                       {.94, .75, .59},
                                       {.96, .85, .73},
                                       {.98, .93, .86},
                                       {1, .99, .96}}};
constexpr std::array<Color, 9> ember{{{.051, .033, .090},
                                      {.160, .101, .257},
                                      {.358, .124, .378},
                                      {.639, .069, .348},
                                      {.798, .254, .208},
                                      {.866, .455, .179},
                                      {.928, .630, .237},
                                      {.975, .801, .477},
                                      {1.00, .963, .875}}};

// Under names that others gave, their colours. viridis: van der Walt and Smith, 2015, CC0; every pixel of 8 bits is
// within one level of all 256 colours. coolwarm: Moreland, Diverging Color Maps for Scientific Visualization, 2009,
// in 33 colours as published. bone: MATLAB's, a grey with the blue of its hot map.
constexpr std::array<Color, 65> viridis{
    {{.267, .0049, .3294},  {.2726, .0255, .353},  {.277, .0502, .3755},  {.2802, .0732, .3969},
     {.2823, .0946, .417},  {.2832, .1153, .4358}, {.2829, .1354, .453},  {.2815, .1553, .4688},
     {.2789, .1749, .483},  {.2753, .1942, .4956}, {.2708, .2133, .5066}, {.2654, .2321, .5162},
     {.2593, .2507, .5244}, {.2525, .2689, .5313}, {.2454, .2867, .537},  {.2379, .3042, .5417},
     {.2302, .3213, .5455}, {.2225, .3381, .5486}, {.2148, .3545, .551},  {.2073, .3706, .553},
     {.2, .3864, .5545},    {.1929, .4019, .5557}, {.1861, .4173, .5567}, {.1796, .4324, .5574},
     {.1733, .4474, .5579}, {.1672, .4623, .5581}, {.1613, .477, .5581},  {.1554, .4918, .5579},
     {.1497, .5064, .5573}, {.144, .5211, .5564},  {.1384, .5358, .5551}, {.1331, .5504, .5533},
     {.1281, .5651, .5509}, {.1239, .5798, .5479}, {.1209, .5945, .5442}, {.1195, .6091, .5397},
     {.1203, .6238, .5343}, {.124, .6383, .528},   {.131, .6529, .5208},  {.1414, .6673, .5126},
     {.1554, .6815, .5032}, {.1727, .6956, .4928}, {.193, .7096, .4812},  {.216, .7232, .4685},
     {.2415, .7366, .4545}, {.2691, .7497, .4394}, {.2986, .7624, .423},  {.3299, .7748, .4054},
     {.3629, .7867, .3866}, {.3972, .7981, .3665}, {.433, .8091, .3453},  {.47, .8194, .3228},
     {.5081, .8292, .2992}, {.5472, .8384, .2745}, {.5873, .847, .2489},  {.628, .8549, .2224},
     {.6694, .8622, .1954}, {.711, .8689, .1685},  {.7529, .8751, .1427}, {.7946, .8808, .1196},
     {.8359, .8861, .1025}, {.8766, .8912, .0953}, {.9166, .8961, .1008}, {.9554, .9011, .1182},
     {.9932, .9062, .1439}}};
constexpr std::array<Color, 33> coolwarm{
    {{.23, .299, .754},     {.2665, .3534, .8017}, {.3041, .4068, .8452}, {.3431, .459, .8839},  {.3833, .5096, .9176},
     {.4246, .5583, .9458}, {.4669, .6047, .9683}, {.5099, .6484, .9849}, {.5532, .689, .9954},  {.5965, .7262, .9999},
     {.6394, .7597, .9982}, {.6814, .789, .9904},  {.7223, .814, .9766},  {.7616, .8343, .9569}, {.7987, .8498, .9317},
     {.8335, .8602, .9011}, {.8654, .8654, .8654}, {.8978, .8489, .8209}, {.9242, .8274, .7746}, {.9446, .801, .7268},
     {.959, .7698, .6781},  {.9675, .7342, .6289}, {.9702, .6944, .5795}, {.9671, .6505, .5304}, {.9583, .603, .4819},
     {.9439, .5519, .4344}, {.9242, .4975, .3881}, {.8994, .4397, .3433}, {.8695, .3785, .3003}, {.8349, .3131, .2593},
     {.796, .2415, .2204},  {.7529, .1575, .1839}, {.706, .016, .15}}};
constexpr std::array<Stop, 4> bone{{{0, {0, 0, 0}},
                                    {23.0 / 63, {.319444, .319444, .444444}},
                                    {47.0 / 63, {.652778, .777778, .777778}},
                                    {1, {1, 1, 1}}}};

template <std::size_t N> std::vector<Stop> evenly(std::array<Color, N> const& colors) {
    std::vector<Stop> stops;
    for (std::size_t i = 0; i < N; ++i) stops.push_back({static_cast<double>(i) / (N - 1), colors[i]});
    return stops;
}

struct Map {
    std::string_view name;
    std::vector<Stop> stops;
};

std::vector<Map> const& maps() {
    static std::vector<Map> const all{{"grey", evenly(grey)},        {"bone", {bone.begin(), bone.end()}},
                                      {"heat", evenly(heat)},        {"tissue", evenly(tissue)},
                                      {"viridis", evenly(viridis)},  {"ember", evenly(ember)},
                                      {"coolwarm", evenly(coolwarm)}};
    return all;
}

} // namespace

std::vector<std::string> colormap_names() {
    return collect(maps(), [](Map const& map) { return std::string(map.name); });
}

Color colormap(std::string_view name, double x) {
    std::string_view base = name;
    x = std::clamp(x, 0.0, 1.0);
    constexpr std::string_view reverse = ":reverse";
    if (base.ends_with(reverse)) {
        base.remove_suffix(reverse.size());
        x = 1 - x;
    }
    for (Map const& map : maps()) {
        if (map.name != base) continue;
        auto const above =
            std::find_if(map.stops.begin() + 1, map.stops.end() - 1, [&](Stop const& s) { return s.at >= x; });
        double const below = (above - 1)->at, f = (x - below) / (above->at - below);
        Color const &a = (above - 1)->color, &b = above->color;
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
