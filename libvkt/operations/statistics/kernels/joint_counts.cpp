// Counting pairs of voxels row by row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/joint_counts.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/physical_values.h"

#include <algorithm>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Calls f(values of a, values of b, n) for pieces of rows.
template <class F> void for_each_piece_of_rows(SlabPair const& pair, F const& f) {
    alignas(64) double a[row_piece], b[row_piece];
    Box const box = pair.a.box;
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
        for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
            for (std::int64_t x = box.lower.x; x < box.upper.x; x += row_piece) {
                std::int64_t const n = std::min(row_piece, box.upper.x - x);
                load_values(pair.a, {x, y, z}, n, pair.map_a, a);
                load_values(pair.b, {x, y, z}, n, pair.map_b, b);
                f(a, b, n);
            }
}

bool finite(double a, double b) { return a - a == 0 && b - b == 0; }

} // namespace

void range_of_pairs(SlabPair const& pair, PairRange& range, Execution const&) {
    for_each_piece_of_rows(pair, [&](double const* a, double const* b, std::int64_t n) {
        for (std::int64_t i = 0; i < n; ++i) {
            if (!finite(a[i], b[i])) continue;
            range.low[0] = std::min(range.low[0], a[i]);
            range.high[0] = std::max(range.high[0], a[i]);
            range.low[1] = std::min(range.low[1], b[i]);
            range.high[1] = std::max(range.high[1], b[i]);
        }
    });
}

void count_pairs(SlabPair const& pair, EqualBins const& bins_a, EqualBins const& bins_b, std::uint64_t* counts,
                 Execution const&) {
    for_each_piece_of_rows(pair, [&](double const* a, double const* b, std::int64_t n) {
        for (std::int64_t i = 0; i < n; ++i)
            if (finite(a[i], b[i])) ++counts[bin_in(bins_a, a[i]) * bins_b.count + bin_in(bins_b, b[i])];
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
