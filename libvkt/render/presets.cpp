// Transfer functions per kind of data.
// SPDX-License-Identifier: MIT
#include "libvkt/render/presets.h"

#include "libvkt/render/colormap.h"

#include <algorithm>
#include <cmath>

namespace vkt::render {
namespace {

double place_of(Preset const& p, double share) {
    return p.logarithmic ? p.lower * std::pow(p.upper / p.lower, share) : std::lerp(p.lower, p.upper, share);
}

double share_of(Preset const& p, double value) {
    double const share = !p.logarithmic ? (value - p.lower) / (p.upper - p.lower)
                         : value > 0    ? std::log(value / p.lower) / std::log(p.upper / p.lower)
                                        : 0;
    return std::clamp(share, 0.0, 1.0);
}

double alpha_at(Preset const& p, double value) {
    auto const after =
        std::find_if(p.opacities.begin(), p.opacities.end(), [&](auto const& o) { return o.first > value; });
    if (after == p.opacities.begin()) return after->second;
    if (after == p.opacities.end()) return p.opacities.back().second;
    auto const &a = *(after - 1), &b = *after;
    return alpha_between(a.second, b.second, (value - a.first) / (b.first - a.first));
}

Preset values_of(DataKind kind, Histogram const& h) {
    switch (kind) {
    case DataKind::ct:
        return {-100, 700, "tissue", {{-20, 0}, {40, 0.01}, {120, 0.02}, {200, 0.06}, {500, 0.5}}};
    case DataKind::ct_bone:
        return {100, 1500, "bone", {{150, 0}, {350, 0.15}, {1200, 0.8}}};
    case DataKind::ct_lung:
        return {-950, -200, "heat:reverse", {{-900, 0}, {-750, 0.02}, {-550, 0.04}, {-400, 0}}};
    case DataKind::ct_contrast:
        return {50, 2500, "tissue", {{100, 0}, {180, 0.02}, {400, 0.1}, {1200, 0.6}, {2000, 0.95}}};
    case DataKind::mr: {
        double const a = h.percentile(0.6), b = h.percentile(0.9), c = h.percentile(0.998);
        return {a, c, "grey", {{a, 0}, {b, 0.04}, {c, 0.3}}};
    }
    case DataKind::fluorescence: {
        double const a = h.percentile(0.9), b = h.percentile(0.99), c = h.percentile(0.9999);
        return {a, c, "inferno", {{a, 0}, {b, 0.05}, {c, 0.6}}};
    }
    case DataKind::density:
        break;
    }
    double const a = std::max(h.percentile(0.05), h.greatest * 1e-6), c = h.greatest;
    Preset preset{a > 0 && a < c ? a : h.least, c, "turbo", {}};
    preset.logarithmic = preset.lower > 0;
    if (!(preset.lower < preset.upper)) preset.lower = preset.upper - 1;
    preset.logarithmic = preset.logarithmic && preset.lower > 0;
    for (auto const& [share, alpha] : {std::pair{0.2, 0.0}, {0.6, 0.02}, {1.0, 0.4}})
        preset.opacities.emplace_back(place_of(preset, share), alpha);
    return preset;
}

} // namespace

Preset preset_of(DataKind kind, Histogram const& histogram) {
    Preset preset = values_of(kind, histogram);
    if (!(preset.lower < preset.upper)) preset.upper = preset.lower + std::max(1.0, std::abs(preset.lower) * 1e-3);
    return preset;
}

TransferFunction transfer_of(Preset const& preset, std::string const& colormap_name) {
    std::string const& map = colormap_name.empty() ? preset.colormap : colormap_name;
    auto const color_at = [&](double value) { return colormap(map, share_of(preset, value)); };
    TransferFunction function;
    for (auto const& [value, alpha] : preset.opacities) function.points.push_back({value, color_at(value), alpha});
    constexpr int parts = 64;
    for (int i = 0; i <= parts; ++i) {
        double const value = place_of(preset, i / static_cast<double>(parts));
        bool const taken = std::ranges::any_of(preset.opacities, [&](auto const& o) { return o.first == value; });
        if (!taken) function.points.push_back({value, color_at(value), alpha_at(preset, value)});
    }
    function.check_and_sort();
    return function;
}

} // namespace vkt::render
