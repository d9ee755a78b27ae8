// The part of a volume that a picture is to show.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/render/minmax.h"

#include <vector>

namespace vkt::render {

/// Corners of boxes of macrocells that hold all that is visible: each row of them from its first visible one to its
/// last.
std::vector<Vec3> visible_corners(CellVisibility const& cells, Index3 counts, Geometry const& geometry,
                                  Box const& within);

/// Voxels that lie in visible macrocells; all of them if there is none.
Box visible_box(CellVisibility const& cells, Index3 dims);

} // namespace vkt::render
