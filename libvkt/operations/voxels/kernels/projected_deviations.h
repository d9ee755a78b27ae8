// Standard deviations of lines of voxels: what they add to a projection.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/voxels/kernels/project.h"

namespace vkt {

/// project_add() on CPUs, for Projection::std: adds to means and sums of squared deviations.
VKT_CPU_KERNEL(project_deviations, (ProjectionState & state, ConstView slab, Execution const& execution),
               (state, slab, execution))

} // namespace vkt
