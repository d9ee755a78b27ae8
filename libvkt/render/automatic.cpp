// The automatic transfer function: from the histogram alone, so that the first picture is neither fog nor black.
// SPDX-License-Identifier: MIT
#include "libvkt/render/render.h"

#include <algorithm>
#include <cmath>

namespace vkt::render {

namespace {

/// Values between background and object: the split of the histogram with the greatest variance between its classes
/// (Otsu 1979), over the bins from `first` to before `end`: the last one of the lower class.
std::size_t otsu(std::vector<std::int64_t> const& bins, std::size_t first, std::size_t end) {
    double count = 0, sum = 0;
    for (std::size_t i = first; i < end; ++i) {
        count += static_cast<double>(bins[i]);
        sum += static_cast<double>(bins[i]) * static_cast<double>(i);
    }
    double below = 0, below_sum = 0, best = -1;
    std::size_t split = first;
    for (std::size_t i = first; i + 1 < end; ++i) {
        below += static_cast<double>(bins[i]);
        below_sum += static_cast<double>(bins[i]) * static_cast<double>(i);
        double const above = count - below;
        if (below <= 0 || above <= 0) continue;
        double const difference = below_sum / below - (sum - below_sum) / above;
        double const between = below * above * difference * difference;
        if (between > best) best = between, split = i;
    }
    return split;
}

/// The lower split of three classes, each the best while the other one stays.
std::size_t lower_of_three(std::vector<std::int64_t> const& bins, std::size_t split) {
    for (int i = 0; i < 16; ++i) {
        std::size_t const upper = otsu(bins, split + 1, bins.size()), lower = otsu(bins, 0, upper + 1);
        if (lower == split) break;
        split = lower;
    }
    return split;
}

} // namespace

/// Everything below the split is clear. Above it, the voxels at or above a value form an object that fills a share F of
/// the volume; a ray that meets it passes through about F^(1/3) of the volume's extent. The extinction is chosen so
/// that this way has an optical depth that rises from faint at the split to opaque at the top: rare, high values stand
/// out of common, low ones, whatever the units of the data are. Where few values of a small object reach so far that
/// most of it would lie at the faint end, as metal in tissue, the split is the lower one of three classes, and a value
/// is the denser the more of the object's are below it.
Automatic choose_transfer(Histogram const& histogram, Domain const& domain, std::string const& colormap_name,
                          double extent, double unit) {
    std::vector<std::int64_t> const& bins = histogram.bins;
    Automatic result;
    double lower = domain.lower, upper = domain.upper;
    auto const share_from = [&](double value) {
        double above = 0, total = 0;
        for (std::size_t i = 0; i < bins.size(); ++i) {
            total += static_cast<double>(bins[i]);
            if (histogram.center(i) >= value) above += static_cast<double>(bins[i]);
        }
        return std::max(above / std::max(total, 1.0), 1e-6);
    };
    double by_rank = 0;
    if (domain.text == "auto") {
        std::size_t const split = otsu(bins, 0, bins.size());
        lower = histogram.value_at(static_cast<double>(split) + 1);
        upper = histogram.percentile(0.9995);
        // A constant object (a mask): its own value is the top.
        if (!(upper > lower)) upper = histogram.greatest;
        double const object = share_from(lower);
        if (object < 0.1 && histogram.percentile(1 - object / 2) < std::lerp(lower, upper, 0.15)) {
            lower = histogram.value_at(static_cast<double>(lower_of_three(bins, split)) + 1);
            by_rank = 0.8;
        }
    }
    // Of a single value it is all that is seen.
    if (!(upper > lower)) lower = upper - (upper != 0 ? 1e-3 * std::abs(upper) : 1);
    std::string const map = colormap_name.empty() ? "tissue" : colormap_name;
    double const all = share_from(lower);
    constexpr int points = 24;
    std::vector<double> extinctions;
    for (int i = 0; i <= points; ++i) {
        double const x = i / static_cast<double>(points), value = std::lerp(lower, upper, x);
        // Common values get a sharper edge: they are solid rather than a few bright spots.
        double const share = share_from(value), dense = x + by_rank * (1 - share / all) * (1 - x),
                     depth = 16 * dense * dense + 200 * share * share * std::sqrt(x);
        double const extinction = depth / (extent * std::cbrt(share));
        extinctions.push_back(extinction);
    }
    // Colour maps bend more often than opacities, which run straight between theirs.
    constexpr int between = 3;
    for (int i = 0; i <= points * between; ++i) {
        auto const k = static_cast<std::size_t>(std::min(i / between, points - 1));
        double const x = i / static_cast<double>(points * between);
        double const extinction =
            std::lerp(extinctions[k], extinctions[k + 1], i / static_cast<double>(between) - static_cast<double>(k));
        result.transfer.points.push_back(
            {std::lerp(lower, upper, x), colormap(map, x), -std::expm1(-extinction * unit)});
    }
    result.iso = std::lerp(lower, upper, 0.3);
    return result;
}

} // namespace vkt::render
