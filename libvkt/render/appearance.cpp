// What settings mean for a volume: colours, opacities, surfaces, labels, and what of it cannot be seen.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/categories.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/prepared.h"
#include "libvkt/render/refuse.h"
#include "libvkt/render/world.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt::render {

namespace {

/// "A0,A1,…" over the domain or "VALUE:A,VALUE:A,…".
std::vector<std::pair<double, double>> read_opacity(std::string const& words, Domain const& domain) {
    std::vector<std::pair<double, double>> ramp;
    auto const parts = split(words, ',');
    for (std::size_t i = 0; i < parts.size(); ++i) {
        auto const pair = split(parts[i], ':');
        bool const placed = pair.size() == 2;
        if (pair.size() > 2 || pair.empty() || (i > 0 && placed != (split(parts[0], ':').size() == 2)))
            refuse(text("--opacity '", words, "' is neither auto nor A,A,… nor VALUE:A,VALUE:A,…"),
                   "for example --opacity 0,0,0.1,0.8");
        double const share = parts.size() > 1 ? static_cast<double>(i) / static_cast<double>(parts.size() - 1) : 1;
        double const value = placed ? parse_double(pair[0]) : std::lerp(domain.lower, domain.upper, share);
        ramp.emplace_back(value, parse_double(pair.back()));
        if (!(ramp.back().second >= 0 && ramp.back().second <= 1))
            refuse(text("--opacity '", words, "' has an opacity outside 0 to 1"));
    }
    return ramp;
}

/// Where a value lies between two others: 0 to 1 from the lower to the upper one; `alone` if these are equal.
double share_of(double value, double lower, double upper, double alone) {
    double const half = upper / 2 - lower / 2; // the whole may be more than doubles hold
    return half > 0 ? (value / 2 - lower / 2) / half : alone;
}

/// A colour map over the domain with opacities of its own: control points wherever either bends.
TransferFunction combine(std::string const& map, Domain const& domain, std::vector<std::pair<double, double>> ramp) {
    std::stable_sort(ramp.begin(), ramp.end(), [](auto const& a, auto const& b) { return a.first < b.first; });
    auto const color_at = [&](double v) { return colormap(map, share_of(v, domain.lower, domain.upper, 0.5)); };
    // Between the opacities it is extinction that runs linearly.
    auto const alpha_at = [&](double v) {
        if (v <= ramp.front().first) return ramp.front().second;
        for (std::size_t i = 1; i < ramp.size(); ++i) {
            if (v > ramp[i].first) continue;
            double const a = extinction_of(ramp[i - 1].second), b = extinction_of(ramp[i].second);
            return -std::expm1(-(a + share_of(v, ramp[i - 1].first, ramp[i].first, 1) * (b - a)));
        }
        return ramp.back().second;
    };
    TransferFunction transfer;
    for (auto const& [value, alpha] : ramp) transfer.points.push_back({value, color_at(value), alpha});
    constexpr int parts = 64;
    for (int i = 0; i <= parts; ++i) {
        double const v = std::lerp(domain.lower, domain.upper, static_cast<double>(i) / parts);
        bool const taken = std::any_of(ramp.begin(), ramp.end(), [&](auto const& r) { return r.first == v; });
        if (!taken) transfer.points.push_back({v, color_at(v), alpha_at(v)});
    }
    transfer.check_and_sort();
    return transfer;
}

} // namespace

std::shared_ptr<Categories const> Renderer::labels_for(RenderSettings const& settings) const {
    if (!draws_labels(settings, header_)) return nullptr;
    bool const asked = settings.labels == LabelMode::always;
    auto& labels = cache_->labels;
    if (!labels) labels = std::make_shared<Categories>(categories_of(lattice_, header_, execution_.threads));
    if (labels->why_not.empty()) return labels;
    if (asked) refuse(text("--labels always: the volume holds ", labels->why_not));
    return nullptr;
}

Renderer::Appearance Renderer::appearance_of(RenderSettings const& settings) const {
    Appearance appearance;
    Geometry const& g = header_.geometry;
    Histogram const& data = settings.chosen_from ? *settings.chosen_from : histogram();
    appearance.domain = resolve_domain(settings.domain, data);
    double const smallest = smallest_spacing(g);
    appearance.unit = settings.transfer && settings.transfer->unit > 0 ? settings.transfer->unit : smallest;
    if (settings.unit == "auto")
        appearance.unit = diagonal(g, region_.dims()) / 256;
    else if (!settings.unit.empty())
        appearance.unit = parse_double(settings.unit);
    if (!(appearance.unit > 0) || !std::isfinite(appearance.unit)) refuse("the unit distance must be positive");

    double voxels = volume_of(region_.dims());
    if (tree_) voxels = std::min(tree_->covered(), voxels);
    double const extent = std::cbrt(voxel_size(g) * voxels);
    Automatic const automatic = choose_transfer(data, appearance.domain, settings.colormap, extent, appearance.unit);
    bool chosen = false;
    if (settings.transfer) {
        appearance.transfer = *settings.transfer;
    } else if (!settings.lut.empty()) {
        appearance.transfer = transfer_from_lut(settings.lut, appearance.domain.lower, appearance.domain.upper);
    } else if (is_projection(settings.algorithm)) {
        appearance.domain = resolve_domain(settings.domain == "auto" ? "minmax" : settings.domain, data);
        appearance.transfer = combine(settings.colormap.empty() ? "grey" : settings.colormap, appearance.domain,
                                      {{appearance.domain.lower, 1}});
    } else if (settings.preset) {
        appearance.transfer = transfer_of(preset_of(*settings.preset, data), settings.colormap);
        chosen = true;
    } else if (settings.opacity != "auto") {
        appearance.transfer = combine(settings.colormap.empty() ? "tissue" : settings.colormap, appearance.domain,
                                      read_opacity(settings.opacity, appearance.domain));
    } else {
        appearance.transfer = automatic.transfer;
        chosen = true;
        // A span of values that is asked for is that of the histogram, and so is what surfaces are chosen from.
        bool const free = settings.domain == "auto" && settings.algorithm != Algorithm::implicit_iso;
        auto const known = free ? recognise(header_, data) : std::nullopt;
        if (known) {
            appearance.transfer = transfer_of(preset_of(known->kind, data), settings.colormap);
            appearance.recognised = text(known->why, ": colours and opacities of --preset ", enum_name(known->kind));
        }
    }
    appearance.transfer.check_and_sort();
    appearance.domain.lower = appearance.transfer.points.front().value;
    appearance.domain.upper = appearance.transfer.points.back().value;
    bool const surfaces = settings.algorithm == Algorithm::implicit_iso;
    appearance.labels = labels_for(settings);
    appearance.shade = settings.shade >= 0 ? settings.shade : surfaces || appearance.labels ? 1 : chosen ? 0.8 : 0;
    if (!surfaces || appearance.labels) return appearance;

    std::vector<double> isos = settings.isos;
    if (isos.empty()) isos.push_back(automatic.iso);
    auto const& [least, greatest] = std::pair(histogram().least, histogram().greatest);
    std::vector<Knot> const knots = knots_of(appearance.transfer, header_.values, rescaling(), 1, 1);
    for (double const iso : isos) {
        double const value = rescaling().of(header_.values.stored(iso));
        Knot const k = evaluate(knots.data(), static_cast<int>(knots.size()), value);
        // What is at the value counts as above it, and above is where stored values are greater.
        bool const met = header_.values.slope > 0 ? least < iso && iso <= greatest : least <= iso && iso < greatest;
        if (!met && settings.isos.empty() && least == greatest)
            appearance.lossy.push_back(text("no surface is there: all values are ", six_digits(least)));
        else if (!met)
            appearance.lossy.push_back(text("no surface of ", iso, " is there: the values are ", six_digits(least),
                                            " to ", six_digits(greatest)));
        std::size_t const i = appearance.isos.size();
        IsoView view{static_cast<float>(value), static_cast<float>(k.red), static_cast<float>(k.green),
                     static_cast<float>(k.blue)};
        if (!settings.iso_colors.empty()) {
            auto const linear = [&](std::size_t c) {
                return static_cast<float>(srgb_to_linear(settings.iso_colors[3 * i + c]));
            };
            view.red = linear(0), view.green = linear(1), view.blue = linear(2);
        }
        if (!settings.iso_opacities.empty()) view.alpha = static_cast<float>(settings.iso_opacities[i]);
        appearance.isos.push_back(view);
        appearance.iso_values.push_back(iso);
    }
    return appearance;
}

std::vector<std::string> Renderer::unseen(Appearance const& appearance, std::vector<Knot> const& knots,
                                          TransferTable const& table) const {
    std::vector<std::string> lines = appearance.lossy;
    if (!appearance.isos.empty() || appearance.labels) return lines;
    double const one = rescaling().of(header_.values.stored(histogram().least)),
                 other = rescaling().of(header_.values.stored(histogram().greatest));
    double const least = std::min(one, other), greatest = std::max(one, other);
    if (!(table.greatest_extinction(static_cast<float>(least), static_cast<float>(greatest)) > 0)) {
        lines.push_back(text("nothing is visible: the opacity of all values, ", six_digits(histogram().least), " to ",
                             six_digits(histogram().greatest), ", is zero"));
        return lines;
    }
    // Floats of wider types were rounded; and no table has nodes closer together than floats can say.
    double const lower = knots.front().value, upper = knots.back().value;
    double const largest =
        std::min(std::max(std::abs(lower), std::abs(upper)), std::max(std::abs(least), std::abs(greatest)));
    double const step = computes_in_double(header_.dtype) ? std::max(largest * 0x1p-23, 0x1p-149) : 0;
    if (appearance.domain.upper > appearance.domain.lower && upper - lower < std::max(256 * step, 1024 * 0x1p-126))
        lines.push_back(text("the colours from ", appearance.domain.lower, " to ", appearance.domain.upper,
                             " are closer together than the values that rays sample"));
    return lines;
}

} // namespace vkt::render
