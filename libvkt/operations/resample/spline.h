// B-splines of degree 3 and 5, and the filter that makes their coefficients of samples.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

namespace vkt {

/// The centred B-spline of degree 3 or 5, 0 from (degree + 1) / 2 on.
long double bspline(int degree, long double t);

/// Samples become coefficients of a spline through them: c(i) = sum over |k| <= radius of weight[|k|] f(i + k), the
/// inverse of the spline's values at whole positions, cut off. A finite sum, unlike the usual recursion, gives the same
/// coefficient in whatever window it is computed, and lets a NaN reach only so far.
struct SplinePrefilter {
    std::vector<long double> weight;
    std::int64_t radius = 0;
    double cut = 0; ///< sum of the |weights| that differ from those of the infinite filter, at most the share asked for
    double gain = 1; ///< sum of |weight| over both sides

    SplinePrefilter() = default;
    SplinePrefilter(int degree, double share);
};

} // namespace vkt
