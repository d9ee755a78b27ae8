// Squared Euclidean distances along one axis, given those within the axes before it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <optional>

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

/// Lines that are worked on side by side, from the first on: what rounds may depend on which these are.
inline constexpr std::int64_t distance_lanes = 16;

/// No voxel of the other kind so far; sums of two of these fit into int32.
inline constexpr std::int32_t no_site = 1 << 30;

/// Distances along rows: squares (whole) or numbers of steps; negative for the other side, if both are wanted.
struct DistanceRows {
    std::optional<double> zero; ///< the stored zero
    bool whole = true;
    bool both_sides = false;
    double weight = 1;                 ///< of a squared step along x
    std::int64_t objects = 0, nan = 0; ///< results: voxels that are
};

/// Voxels of 4 bytes of `out` become distances along their rows of `in`.
VKT_KERNEL(distance_rows, (ConstView in, AnyView out, DistanceRows& rows, Execution const& execution),
           (in, out, rows, execution))

/// In place: voxels of 4 bytes of `out` go from the distances so far to those with this axis.
VKT_KERNEL(distance_pass, (AnyView out, DistancePass const& pass, Execution const& execution), (out, pass, execution))

} // namespace vkt
