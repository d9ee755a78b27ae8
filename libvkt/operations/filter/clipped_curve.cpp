// Curves of bricks, from counts that are whole numbers: in double precision, rounded a few times.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/clipped_curve.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

namespace vkt {
namespace {

/// The height at which to cut so that no bin is higher than `limit` after what is cut off is spread over all of them.
double pizer_cut(std::span<std::uint64_t const> counts, double limit) {
    std::vector<std::uint64_t> heights(counts.begin(), counts.end());
    std::sort(heights.begin(), heights.end(), std::greater<>());
    auto const n = static_cast<double>(heights.size());
    double above = 0; // sum of the bins that are cut
    for (std::size_t m = 0; m < heights.size(); ++m) {
        // With m bins cut at c, c + (above - m c) / n = limit.
        auto const cut = static_cast<double>(m);
        double const c = (n * limit - above) / (n - cut);
        if (c >= static_cast<double>(heights[m])) return c;
        above += static_cast<double>(heights[m]);
    }
    return 0;
}

} // namespace

std::vector<double> clipped_curve(std::span<std::uint64_t const> counts, ClipLimit const& limit) {
    auto const n = static_cast<double>(counts.size());
    std::vector<double> curve(counts.size() + 1);
    auto const voxels =
        static_cast<double>(std::accumulate(counts.begin(), counts.end(), std::uint64_t{0})); // below 2^62
    if (voxels == 0) {
        for (std::size_t i = 0; i < curve.size(); ++i) curve[i] = static_cast<double>(i) / n;
        return curve;
    }
    double const cut =
        limit.rule != ClipRule::pizer
            ? height_to_cut(limit, voxels, n, static_cast<double>(*std::max_element(counts.begin(), counts.end())))
        : limit.clip > 1 ? pizer_cut(counts, limit.clip * voxels / n)
                         : 0;
    std::uint64_t above = 0, cut_bins = 0;
    for (std::uint64_t const count : counts)
        if (static_cast<double>(count) > cut) {
            above += count;
            ++cut_bins;
        }
    CutHistogram const histogram = CutHistogram::of(voxels, cut, above, cut_bins, n);
    std::uint64_t whole = 0, cut_below = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        curve[i] = histogram.share_below(static_cast<double>(i), cut_below, whole);
        if (static_cast<double>(counts[i]) > cut)
            ++cut_below;
        else
            whole += counts[i];
    }
    curve.back() = 1;
    return curve;
}

} // namespace vkt
