// Structured to hierarchical: keeps fine bricks only where a coarser level does not reproduce the voxels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/reconstruct.h"

#include <optional>

namespace vkt {

struct RefineOptions {
    double tolerance = 0;   ///< largest |reconstruction - voxel| at voxel centres, in stored values
    std::int64_t block = 8; ///< cells of a brick along each axis, 1 … 64
    int levels = 8;         ///< most levels, 1 … 16
    Reconstruction method = Reconstruction::basis; ///< the promise holds for basis or for nearest
    std::optional<double> background; ///< blocks within the tolerance of this value are left out: a sparse volume
};

/// Builds the coarsest tree of octree blocks whose reconstruction at the voxels' centres stays within the tolerance:
/// starts from blocks that their level's means (interpolated) reproduce, then checks the whole reconstruction and
/// splits what fails until nothing does. Coarse cells are means of their voxels. Blocks at edges that no coarse cell
/// fits stay fine. Attribute "background" names the physical value of left-out blocks. Throws Error{usage}.
/// Memory: the volume, 8/7 doubles for every eighth voxel, the tree. O(voxels * levels).
Volume refine(Volume const& volume, RefineOptions const& options, Execution const& execution);

} // namespace vkt
