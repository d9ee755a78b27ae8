// Local means and covariances of two boxes of voxels under a Gaussian window, and the index that follows from them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Positions along x whose indices are summed up together.
inline constexpr std::int64_t similarity_segment = 32;
inline constexpr std::int64_t window_radius = 5;

/// Two volumes' voxels at `inner` and as many around it as the window reaches.
struct WindowedPair {
    ConstView a, b;
    ValueMap map_a, map_b;
    Box inner;                         ///< positions to compute at
    Index3 radius;                     ///< of the window along each axis, window_radius or 0 for none
    double weights[window_radius + 1]; ///< of the window from its middle on; their sum over both sides is 1
    double offset;                     ///< is taken off both values first
    double c1, c2;                     ///< of the index
    double* planes; ///< scratch of CPUs: 5 * (nz + 2 radius.z) planes of nx * ny values, where n are inner.dims()
};

/// rows[(y + z * ny) * segments + s]: the sum of the structural similarity index (Wang and others, 2004) over the s-th
/// segment of a row of positions, in order. `segments`: those that a row has, the last one may be shorter.
VKT_KERNEL(similarity_rows, (WindowedPair const& pair, double* rows, Execution const& execution),
           (pair, rows, execution))

} // namespace vkt
