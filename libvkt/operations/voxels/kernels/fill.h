// Filling a box with one voxel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Every voxel of `out` becomes this one.

VKT_KERNEL(fill_box, (AnyView out, VoxelBytes const& voxel, Execution const& execution), (out, voxel, execution))

} // namespace vkt
