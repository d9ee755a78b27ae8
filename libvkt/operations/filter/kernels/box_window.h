// Sums, least and greatest voxels of boxes and balls around every voxel, at a cost that hardly depends on the box.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/filter/kernels/continuation.h"

namespace vkt {

/// Which voxel of a window: NaN counts as larger than all numbers.
enum class WindowExtreme : std::uint8_t { least, greatest };

/// Mean of the (2 rx + 1)(2 ry + 1)(2 rz + 1) voxels around each, rounded once to the type. `in` covers them, on CPUs
/// without what lies outside the volume: rows that are there more than once are then summed up once. Integers
/// are summed exactly below 2^53, floats in float64; sums of float64 that would overflow are made of smaller voxels. A
/// NaN spoils its boxes and nothing else.
VKT_KERNEL(mean_of_boxes,
           (ConstView in, AnyView out, Index3 radius, Continuation const& beyond, Losses& losses,
            Execution const& execution),
           (in, out, radius, beyond, losses, execution))
VKT_KERNEL(extreme_of_boxes,
           (ConstView in, AnyView out, Index3 radius, Continuation const& beyond, WindowExtreme extreme,
            Execution const& execution),
           (in, out, radius, beyond, extreme, execution))
/// The same of ellipsoids with these half axes: offsets with (x / rx)^2 + (y / ry)^2 + (z / rz)^2 <= 1. `in` covers
/// them.
VKT_KERNEL(extreme_of_balls,
           (ConstView in, AnyView out, Index3 radius, WindowExtreme extreme, Execution const& execution),
           (in, out, radius, extreme, execution))
/// out = a - b, rounded and saturated.
VKT_KERNEL(difference_of, (ConstView a, ConstView b, AnyView out, Losses& losses, Execution const& execution),
           (a, b, out, losses, execution))

/// How a CPU divides an output of these dims among threads: into tiles of all columns, some rows and some slices.
struct BoxLayout {
    BoxLayout(Index3 dims, Index3 radius, std::size_t value_bytes, int threads);

    std::int64_t tiles() const { return bands * layers; }
    /// The i-th, of an output of those dims.
    Box tile(Box const& out, std::int64_t i) const {
        Index3 const n = out.dims();
        Box tile = out;
        tile.lower.y = out.lower.y + i % bands * n.y / bands;
        tile.upper.y = out.lower.y + (i % bands + 1) * n.y / bands;
        tile.lower.z = out.lower.z + i / bands * n.z / layers;
        tile.upper.z = out.lower.z + (i / bands + 1) * n.z / layers;
        return tile;
    }

    std::int64_t bands, layers; ///< along y and along z
    std::int64_t pitch, line;   ///< values of a row, and of one with what is around it: whole registers
    std::int64_t together;      ///< of these, that windows are made of at a time
    std::int64_t columns;       ///< that windows of rows are worked on at a time, so that they stay in the first caches
    std::int64_t kept;          ///< slices of windows that are kept, since what lies outside has them once more
    std::int64_t slice, values; ///< values of a slice of a tile, and all that a tile needs
};

/// Bytes that mean_of_boxes and extreme_of_boxes take beside their views for an output of these dims, with values of so
/// many bytes.
std::size_t box_window_bytes(Index3 dims, Index3 radius, std::size_t value_bytes, Execution const& execution);
/// The same for extreme_of_balls.
std::size_t ball_window_bytes(Index3 radius, std::size_t value_bytes, int threads);
/// Bytes of what mean_of_boxes adds up.
std::size_t box_sum_bytes(DataType type, Index3 radius);
/// Columns of an output tile of extreme_of_balls, and its rows.
Index3 ball_tile(Index3 radius);

} // namespace vkt
