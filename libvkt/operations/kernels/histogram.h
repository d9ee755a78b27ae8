// The histogram: counts of voxels in bins, of a whole volume or of every brick of a grid of equal bricks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/bins.h"

#include <algorithm>
#include <cstdint>

namespace vkt {

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
        std::int64_t const n = box.dims()[axis], b = bricks[axis], at = (voxel - box.lower[axis]) * b;
        return std::min(at + b, (k + 1) * n) - std::max(at, k * n);
    }
    /// The parts of all voxels of a brick together, which is the same for all of them.
    std::int64_t mass() const { return box.dims().x * box.dims().y * box.dims().z; }
};

/// Adds the voxels of in.box that lie in the grid to `counts`: bins.slots() counters a brick, bricks x fastest, in
/// parts of voxels (whole ones if there is a single brick). The counts do not depend on how a volume is cut, nor on
/// threads.
VKT_CPU_KERNEL(count_in_bins,
               (ConstView in, Bins const& bins, BrickGrid const& grid, std::uint64_t* counts,
                Execution const& execution),
               (in, bins, grid, counts, execution))

} // namespace vkt
