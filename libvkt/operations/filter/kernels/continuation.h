// How a volume goes on outside, for filters that find the voxels that stand there themselves.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

namespace vkt {

struct Continuation {
    Index3 dims; ///< of the volume
    Boundary boundary = Boundary::mirror;
    double border_value = 0; ///< stored
};

} // namespace vkt
