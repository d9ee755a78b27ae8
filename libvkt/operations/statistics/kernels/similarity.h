// Local means and covariances of two blocks of values under a Gaussian window, and the index that follows from them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Two blocks of values, x fastest, less an offset that both have in common, with as many values around the inner ones
/// as the window reaches.
struct WindowedPair {
    double const* a;
    double const* b;
    Index3 inner;          ///< positions to compute at
    Index3 radius;         ///< of the window along each axis, 0 for none
    double const* weights; ///< of the window from its middle on; their sum over both sides is 1
    double offset;         ///< that both values lack
    double c1, c2;         ///< of the index
    double* planes;        ///< scratch: 5 * (inner.z + 2 radius.z) planes of inner.x * inner.y values
};

/// rows[y + z * inner.y]: the sum of the structural similarity index (Wang and others, 2004) over a row of positions,
/// in order.
VKT_CPU_KERNEL(similarity_rows, (WindowedPair const& pair, double* rows, Execution const& execution),
               (pair, rows, execution))

} // namespace vkt
