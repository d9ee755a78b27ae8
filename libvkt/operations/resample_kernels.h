// What the resampling kernels are told.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample_weights.h"

namespace vkt {

/// Everything that the weighted kernel needs besides the voxels.
struct WeightedSum {
    Taps x, y, z;
    double divisor = 1;
    double scale = 1, offset = 0; ///< applied before the value is stored
    bool x_identity = false;
};

} // namespace vkt
