// What blocks of threads count: parts of bricks, in rows that are cut into segments.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/operations/statistics/kernels/histogram.h"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace vkt::VKT_BACKEND::driver {

/// Rows are cut into segments; a warp takes one after the other. Of these voxels a lane has 240, however many it loads
/// at once, and a byte counts 255.
inline constexpr std::int64_t count_segment = 7680;

/// What one block of threads counts.
struct CountItem {
    std::int64_t counters = 0;        ///< index of the brick's first one
    std::int64_t x = 0, y = 0, z = 0; ///< the brick's first voxel in the view
    std::int64_t nx = 0, ny = 0;      ///< voxels in a row, rows in a slice
    std::int64_t begin = 0, end = 0;  ///< segments of the rows, row after row
    std::int64_t brick_y = 0, brick_z = 0;
    std::int64_t first = 1, last = 1; ///< weights of the ends of rows
};

/// Segment s of an item: n voxels of row (y, z) of the view, from the item's voxel `begin` along x on.
struct CountSegment {
    std::int64_t begin, y, z;
    int n;
    std::byte const* from;

    __device__ __forceinline__ CountSegment(DeviceRows const& in, CountItem const& item, std::int64_t s) {
        std::int64_t const in_row = (item.nx + count_segment - 1) / count_segment, row = quotient_of(s, in_row);
        begin = (s - row * in_row) * count_segment;
        std::int64_t const slice = quotient_of(row, item.ny);
        y = item.y + row - slice * item.ny;
        z = item.z + slice;
        n = static_cast<int>(item.nx - begin < count_segment ? item.nx - begin : count_segment);
        from = in.at(item.x + begin, y, z);
    }
};

/// Weights of rows: where the grid begins in the view, and how it is cut.
struct CountGrid {
    Index3 before; ///< voxels between the grid's first and the view's
    Index3 dims, bricks;
};

/// True if no brick ends within a voxel: all have the same weight, one for each brick.
inline bool is_even(BrickGrid const& grid) {
    Index3 const dims = grid.box.dims();
    return dims.x % grid.bricks.x == 0 && dims.y % grid.bricks.y == 0 && dims.z % grid.bricks.z == 0;
}

/// The parts of bricks in a slab, each no more than 32 bits count.
inline std::vector<CountItem> count_items(Box const& slab, BrickGrid const& grid, std::size_t slots, Index3 lower,
                                          bool packed) {
    std::vector<CountItem> items;
    double const weight =
        static_cast<double>(grid.bricks.x) * static_cast<double>(grid.bricks.y) * static_cast<double>(grid.bricks.z);
    constexpr std::int64_t least = 32768, blocks = 4096;
    for_each_brick(slab, grid, [&](Index3 brick, Box const& box) {
        std::int64_t const nx = box.dims().x, segments = (nx + count_segment - 1) / count_segment,
                           total = segments * box.dims().y * box.dims().z;
        std::int64_t const voxels = std::max({least, box.voxels() / blocks, static_cast<std::int64_t>(4 * slots)});
        double const held = (packed ? 65535.0 : 0x1p31 / weight) / static_cast<double>(std::min(nx, count_segment));
        std::int64_t const each = std::clamp<std::int64_t>(voxels / std::min(nx, count_segment), 1,
                                                           std::max<std::int64_t>(1, static_cast<std::int64_t>(held)));
        for (std::int64_t begin = 0; begin < total; begin += each) {
            CountItem item;
            item.counters =
                (brick.x + grid.bricks.x * (brick.y + grid.bricks.y * brick.z)) * static_cast<std::int64_t>(slots);
            Index3 const at = box.lower - lower;
            item.x = at.x;
            item.y = at.y;
            item.z = at.z;
            item.nx = nx;
            item.ny = box.dims().y;
            item.begin = begin;
            item.end = std::min(begin + each, total);
            item.brick_y = brick.y;
            item.brick_z = brick.z;
            item.first = grid.share(0, box.lower.x, brick.x);
            item.last = grid.share(0, box.upper.x - 1, brick.x);
            items.push_back(item);
        }
    });
    return items;
}

} // namespace vkt::VKT_BACKEND::driver
