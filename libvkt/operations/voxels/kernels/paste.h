// Converting voxels from one value map to another.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

/// out has the physical values of in, in double precision.
VKT_KERNEL(paste_mapped,
           (ConstView in, AnyView out, ValueMap const& from, ValueMap const& to, Losses& losses,
            Execution const& execution),
           (in, out, from, to, losses, execution))

} // namespace vkt
