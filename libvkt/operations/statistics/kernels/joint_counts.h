// What pairs of voxels have for values: their ranges, and how many lie in each pair of bins.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/statistics/kernels/difference.h"

#include <cstdint>

namespace vkt {

/// Extremes of both volumes over the pairs of which both values are finite; low > high if there are none.
struct PairRange {
    double low[2], high[2];
};

/// Bins of equal width. `edges`: one more than there are bins, ascending.
struct EqualBins {
    double const* edges;
    int count;
    double scale; ///< bins per unit
};

namespace VKT_BACKEND {

/// The bin of a value between the first edge and the last: a guess, which the edges beside it correct.
VKT_HD int bin_in(EqualBins const& bins, double value) {
    int const last = bins.count - 1;
    double const guess = (value - bins.edges[0]) * bins.scale;
    int k = guess > 0 ? guess < last ? static_cast<int>(guess) : last : 0;
    while (k > 0 && value < bins.edges[k]) --k;
    while (k < last && value >= bins.edges[k + 1]) ++k;
    return k;
}

} // namespace VKT_BACKEND

/// Widens `range` to what a slab of pairs has.
VKT_KERNEL(range_of_pairs, (SlabPair const& pair, PairRange& range, Execution const& execution),
           (pair, range, execution))

/// Counts the pairs of which both values are finite: counts[i * b.count + j], i being the bin of a's value.
VKT_KERNEL(count_pairs,
           (SlabPair const& pair, EqualBins const& a, EqualBins const& b, std::uint64_t* counts,
            Execution const& execution),
           (pair, a, b, counts, execution))

} // namespace vkt
