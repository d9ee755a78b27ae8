// The region that --roi keeps an operation to, on grids and on every level of trees.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/roi.h"

namespace vkt {

/// Voxels of a grid, or the cells of a level with centres in a region of finest cells. Without a region the whole
/// volume; of a tree that was cropped that is what is left of it, and so is an axis that is taken whole.
class LevelRegion {
public:
    LevelRegion() = default;
    /// Throws Error{usage} if the region does not lie in the volume.
    LevelRegion(Roi const& roi, Header const& volume);

    void enter_level(Index3 cell_width, Index3 first);
    Box const& box() const { return box_; }       ///< in voxels, or cells of the level
    Box const& finest() const { return finest_; } ///< in voxels, or finest cells
    /// What of a box lies in the region; all of it if none was given.
    Box part_of(Box const& box) const { return given_ ? intersect(box, box_) : box; }

private:
    Box box_, finest_;
    bool given_ = false;
};

} // namespace vkt
