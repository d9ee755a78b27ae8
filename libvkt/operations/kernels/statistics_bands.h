// What back ends sum of a band of rows, and what follows from it on the host: the same bits everywhere.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/statistics.h"

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

/// Statistics of a band, its mean less `origin`. `doubles`: the voxels are float64, whose differences need the room.
void finish_band(FloatBand const& band, bool doubles, double origin, BandStatistics& out);

/// The same of what a GPU summed: of voxels of this type, without products.
void finish_bands(FloatBand const* bands, std::int64_t count, DataType type, MeanOrigin const& origin,
                  BandStatistics* out, int threads);
void finish_bands(IntegerBand const* bands, std::int64_t count, DataType type, MeanOrigin const& origin,
                  BandStatistics* out, int threads);
void finish_products(BandProduct const* products, std::int64_t count, BandStatistics* out, int threads);

} // namespace vkt
