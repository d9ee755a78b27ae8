// Copying a volume and what continues it outside.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Output voxel p is input voxel fold(p - below), or the border.
struct PadRule {
    Index3 below, dims; ///< dims of the input
    Boundary boundary = Boundary::border;
    VoxelBytes border{};
};

VKT_KERNEL(pad_box, (ConstView in, AnyView out, PadRule const& rule, Execution const& execution),
           (in, out, rule, execution))

} // namespace vkt
