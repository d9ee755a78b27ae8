// The median of a neighbourhood.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// out(p) = the middle one, in ascending order, of the (2 rx + 1)(2 ry + 1)(2 rz + 1) voxels around p; `in` covers
/// them. Both of one type. NaN counts as larger than all numbers.

VKT_KERNEL(median_of_boxes, (ConstView in, AnyView out, Index3 radius, Execution const& execution),
           (in, out, radius, execution))

Index3 median_tile(Index3 radius);

} // namespace vkt
