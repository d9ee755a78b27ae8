// Squared Euclidean distances along one axis, given those within the axes before it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Squared distances are whole numbers of `weight` times squared numbers of voxels below no_site (int32), or float32
/// that double is rounded to. Those of voxels on the other side are kept as negative numbers, if there are such.
struct DistancePass {
    Axis axis = Axis::y; ///< y or z
    bool whole = true;   ///< int32 rather than float32
    bool both_sides = false;
    double weight = 1;        ///< of a squared step along this axis
    double weight_before = 0; ///< not 0: voxels hold numbers of steps along x, of which this is the squared step
    double unit = 0;          ///< not 0: the last pass, whose results are roots times the unit, in float32
};

/// No voxel of the other kind so far; sums of two of these fit into int32.
inline constexpr std::int32_t no_site = 1 << 30;

/// In place: voxels of 4 bytes of `out` go from the distances so far to those with this axis.
VKT_CPU_KERNEL(distance_pass, (AnyView out, DistancePass const& pass, Execution const& execution),
               (out, pass, execution))

} // namespace vkt
