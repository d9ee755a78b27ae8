// Sums, least and greatest voxels of boxes and balls around every voxel, at a cost that hardly depends on the box.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Which voxel of a window: NaN counts as larger than all numbers.
enum class WindowExtreme : std::uint8_t { least, greatest };

/// Mean of the (2 rx + 1)(2 ry + 1)(2 rz + 1) voxels around each, rounded once to the type; `in` covers them. Integers
/// are summed exactly below 2^53, floats in float64; sums of float64 that would overflow are made of smaller voxels. A
/// NaN spoils its boxes and nothing else.
VKT_KERNEL(mean_of_boxes, (ConstView in, AnyView out, Index3 radius, Losses& losses, Execution const& execution),
           (in, out, radius, losses, execution))
VKT_KERNEL(extreme_of_boxes,
           (ConstView in, AnyView out, Index3 radius, WindowExtreme extreme, Execution const& execution),
           (in, out, radius, extreme, execution))
/// The same of ellipsoids with these half axes: offsets with (x / rx)^2 + (y / ry)^2 + (z / rz)^2 <= 1.
VKT_KERNEL(extreme_of_balls,
           (ConstView in, AnyView out, Index3 radius, WindowExtreme extreme, Execution const& execution),
           (in, out, radius, extreme, execution))
/// out = a - b, rounded and saturated.
VKT_KERNEL(difference_of, (ConstView a, ConstView b, AnyView out, Losses& losses, Execution const& execution),
           (a, b, out, losses, execution))

/// Columns that windows of w rows of n values are worked on at a time, so that they stay in the second cache.
[[gnu::always_inline]] inline std::int64_t window_columns(std::int64_t w, std::int64_t n, std::size_t value_bytes) {
    std::int64_t const fit = (std::int64_t{1} << 18) / (w * static_cast<std::int64_t>(value_bytes)) / 64 * 64;
    std::int64_t const columns = fit < 64 ? 64 : fit > 1024 ? 1024 : fit;
    return columns < n ? columns : n;
}

/// Bytes that mean_of_boxes and extreme_of_boxes take beside their views for an output of these dims, with values of so
/// many bytes.
std::size_t box_window_bytes(Index3 dims, Index3 radius, std::size_t value_bytes, int threads);
/// The same for extreme_of_balls.
std::size_t ball_window_bytes(Index3 radius, std::size_t value_bytes, int threads);
/// Bytes of what mean_of_boxes adds up.
std::size_t box_sum_bytes(DataType type, Index3 radius);
/// Columns of an output tile of extreme_of_balls, and its rows.
Index3 ball_tile(Index3 radius);

} // namespace vkt
