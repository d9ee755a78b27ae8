// The histogram: counts of voxels in bins, of a whole volume or of every brick of a grid of equal bricks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/statistics/bins.h"

#include <algorithm>
#include <cstdint>

namespace vkt {

/// The share of one of n voxels that lies in brick k of so many, in parts of which a voxel has `bricks`.
VKT_HD std::int64_t share_of_voxel(std::int64_t voxel, std::int64_t k, std::int64_t n, std::int64_t bricks) {
    std::int64_t const at = voxel * bricks, end = (k + 1) * n, begin = k * n;
    return (at + bricks < end ? at + bricks : end) - (at > begin ? at : begin);
}

/// A box cut into equal bricks, whose faces may lie within voxels: a voxel then belongs to the bricks on both sides, to
/// each in proportion. So it makes no difference from which side voxels are counted. There are no more bricks along an
/// axis than voxels.
struct BrickGrid {
    Box box;
    Index3 bricks{1, 1, 1};

    std::int64_t count() const { return bricks.x * bricks.y * bricks.z; }
    /// Voxels that brick k has a share of along an axis.
    std::int64_t first(int axis, std::int64_t k) const { return box.lower[axis] + k * box.dims()[axis] / bricks[axis]; }
    std::int64_t end(int axis, std::int64_t k) const {
        return box.lower[axis] + ((k + 1) * box.dims()[axis] + bricks[axis] - 1) / bricks[axis];
    }
    /// The brick in which the first part of a voxel lies.
    std::int64_t brick_at(int axis, std::int64_t voxel) const {
        return (voxel - box.lower[axis]) * bricks[axis] / box.dims()[axis];
    }
    /// The share of a voxel that lies in brick k, in parts of which a voxel has bricks[axis].
    std::int64_t share(int axis, std::int64_t voxel, std::int64_t k) const {
        return share_of_voxel(voxel - box.lower[axis], k, box.dims()[axis], bricks[axis]);
    }
    /// The parts of all voxels of a brick together, which is the same for all of them.
    std::int64_t mass() const { return box.dims().x * box.dims().y * box.dims().z; }
};

/// Calls f(brick, box) for the parts of bricks in a slab, x fastest.
template <class F> void for_each_brick(Box const& slab, BrickGrid const& grid, F const& f) {
    Index3 low, high; // bricks that the slab meets
    for (int axis = 0; axis < 3; ++axis) {
        low[axis] = grid.brick_at(axis, slab.lower[axis]);
        high[axis] = grid.brick_at(axis, slab.upper[axis] - 1) + 1;
        // The last voxel may also have a share in the brick after its first.
        if (high[axis] < grid.bricks[axis] && grid.first(axis, high[axis]) < slab.upper[axis]) ++high[axis];
    }
    for (std::int64_t z = low.z; z < high.z; ++z)
        for (std::int64_t y = low.y; y < high.y; ++y)
            for (std::int64_t x = low.x; x < high.x; ++x) {
                Box const box = intersect(slab, {{grid.first(0, x), grid.first(1, y), grid.first(2, z)},
                                                 {grid.end(0, x), grid.end(1, y), grid.end(2, z)}});
                if (!box.empty()) f(Index3{x, y, z}, box);
            }
}

/// Adds the voxels of in.box that lie in the grid to `counts`: bins.slots() counters a brick, bricks x fastest, in
/// parts of voxels (whole ones if there is a single brick). They lie in the memory of `execution`, like the voxels. The
/// counts do not depend on how a volume is cut, nor on threads.
VKT_KERNEL(count_in_bins,
           (ConstView in, Bins const& bins, BrickGrid const& grid, std::uint64_t* counts, Execution const& execution),
           (in, bins, grid, counts, execution))

} // namespace vkt
