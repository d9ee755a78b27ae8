// The part of a volume that a picture is to show.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/render/minmax.h"
#include "libvkt/render/tree_cells.h"

#include <vector>

namespace vkt::render {

/// Where macrocells lie: number i of them holds what is seen of voxels [origin + i size, origin + (i + 1) size + more).
struct CellPlaces {
    Index3 counts, origin;
    std::int64_t size, more;
};
/// Those of a lattice, and of a tree.
CellPlaces places_of(CellGrid const& grid);
CellPlaces places_of(TreeCells const& cells);

/// Corners of boxes of macrocells that hold all that is visible: each row of them from its first visible one to its
/// last. What has no data is not.
std::vector<Vec3> visible_corners(CellVisibility const& cells, CellPlaces const& places, Geometry const& geometry,
                                  Box const& within);

/// Voxels that lie in visible macrocells; all of them if there is none.
Box visible_box(CellVisibility const& cells, Index3 dims);

} // namespace vkt::render
