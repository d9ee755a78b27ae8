// Filling what lies outside a volume, and copying regions, wherever the memory is.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/view.h"

namespace vkt {

/// Fills all voxels of `window` outside `inside` (the part that holds real voxels) by the boundary rule, axis by axis:
/// x, then y, then z. Sources of the folded voxels must lie in `inside` along each axis; it may reach beyond the
/// volume, where voxels were read that wrap around. With Boundary::border, or where `inside` is empty, `border_value`
/// is stored.
void fill_border(AnyView window, Box const& inside, Index3 volume_dims, Boundary boundary, double border_value,
                 Execution const& execution);

/// Copies voxels between views of equal type and dims (lower corners may differ), host or device on either side.
void copy_region(ConstView from, AnyView to, Execution const& execution);

/// Copies every step-th voxel of one view, from its first on, to another of equal type in the same memory.
void copy_every(ConstView from, Index3 step, AnyView to);

} // namespace vkt
