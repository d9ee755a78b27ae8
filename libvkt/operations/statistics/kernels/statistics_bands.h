// What back ends sum of a band of rows, and what follows from it on the host: the same bits everywhere.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/host_device.h"
#include "libvkt/operations/statistics/statistics.h"

#include <cmath>

namespace vkt {

/// Sums of differences from `shift` and of their squares, of values taken `scale` times; what is not finite is counted
/// apart.
struct FloatBand {
    std::int64_t count = 0, nan = 0, above = 0, below = 0;
    double sum = 0, squares = 0;
    double shift = 0, scale = 1; ///< the shift is that of unscaled values
    double low = 0, high = 0;    ///< of all that is a number
};

/// Integers: sums are exact, but for the deviations of 64-bit ones, which are added in the order of the voxels.
struct IntegerBand {
    std::int64_t count = 0, low = 0, high = 0, first = 0; ///< uint64: the same bits
    Int128 sum = 0;
    std::uint64_t squares_low = 0, squares_high = 0; ///< sums of the halves of squares
    double s = 0, q = 0;
};

/// The product of what one of a band's lanes multiplies: a mantissa in [1,2), or 0.
struct LaneProduct {
    double mantissa = 1;
    std::int64_t exponent = 0;
};
inline constexpr int statistics_lanes = 16;

/// The product of a band, as a host has it in long double: the mantissa's bits, the highest of which is 1, or 0.
struct BandProduct {
    std::uint64_t mantissa = std::uint64_t{1} << 63;
    std::int64_t exponent = 0, negative = 0;
};

/// What a slice has of the bands of a back end that merges them itself: of floats of up to 32 bits or of integers of up
/// to 32. Integer sums and extremes begin anew, moments and product of the first slice go on from what they were.
struct SliceSums {
    FloatMoments moments;
    BandProduct product;
    Int128 sum = 0;
    Unsigned128 squares = 0;
    double low = 0, high = 0;                   ///< floats
    std::int64_t lowest = 0, highest = 0;       ///< integers
    std::int64_t low_band = -1, high_band = -1; ///< the first that has them; -1: no number
};

/// What such sums begin with, and what follows from them; `type`: of the voxels.
SliceSums begin_slice(SliceStatistics const& slice);
void finish_slice(SliceSums const& sums, DataType type, SliceStatistics& out);

/// Moments of a band of floats of up to 32 bits, their mean less `origin`.
VKT_HD FloatMoments moments_of(FloatBand const& band, double origin) {
    FloatMoments m;
    m.nan = band.nan;
    m.above = band.above;
    m.below = band.below;
    m.finite = band.count - band.nan - band.above - band.below;
    if (m.finite == 0) return m;
    auto const n = static_cast<double>(m.finite);
    double const product = n * band.shift, sum = product + band.sum, back = sum - product;
    double const deviations = band.squares - band.sum * band.sum / n;
    m.sum = sum;
    m.sum_error = (product - (sum - back)) + (band.sum - back) + fma(n, band.shift, -product);
    m.deviations = deviations > 0 ? deviations : 0;
    m.mean = (band.shift - origin) + band.sum / n;
    return m;
}

/// Statistics of a band, its mean less `origin`. `doubles`: the voxels are float64, whose differences need the room.
void finish_band(FloatBand const& band, bool doubles, double origin, BandStatistics& out);

/// The same of what a GPU summed: of voxels of this type, without products.
void finish_bands(FloatBand const* bands, std::int64_t count, DataType type, MeanOrigin const& origin,
                  BandStatistics* out, int threads);
void finish_bands(IntegerBand const* bands, std::int64_t count, DataType type, MeanOrigin const& origin,
                  BandStatistics* out, int threads);
void finish_products(BandProduct const* products, std::int64_t count, BandStatistics* out, int threads);

} // namespace vkt
