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

/// Statistics of a band, its mean less `origin`. `doubles`: the voxels are float64, whose differences need the room.
inline void finish_band(FloatBand const& band, bool doubles, double origin, BandStatistics& out) {
    Moments& m = out.moments;
    m = {};
    m.nan = band.nan;
    m.positive_infinity = band.above;
    m.negative_infinity = band.below;
    m.finite = band.count - band.nan - band.above - band.below;
    if (m.finite > 0) {
        auto const n = static_cast<double>(m.finite);
        double const shift = band.shift * band.scale;
        double const product = n * shift;
        double const sum = product + band.sum, back = sum - product;
        double const error = (product - (sum - back)) + (band.sum - back) + __builtin_fma(n, shift, -product);
        double const deviations = band.squares - band.sum * band.sum / n;
        m.deviations = deviations > 0 || deviations != deviations ? deviations : 0;
        long double const unscaled = 1 / static_cast<long double>(band.scale);
        m.sum = sum * unscaled;
        m.sum_error = error * unscaled;
        m.deviations *= unscaled * unscaled;
        if (doubles)
            m.mean = (band.shift - static_cast<long double>(origin)) + band.sum / n * unscaled;
        else
            m.mean = (shift - origin) + band.sum / n;
    }
    out.range = {};
    out.range.valid = band.count > band.nan;
    out.range.low = band.low;
    out.range.high = band.high;
}

} // namespace vkt
