// What the resampling kernels are told.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"
#include "libvkt/operations/resample_weights.h"

namespace vkt {

/// Everything that the weighted kernels need besides the voxels.
struct WeightedSum {
    Taps x, y, z;
    double divisor = 1;           ///< product of the axes' divisors
    double unit = 1;              ///< power of two that all weights are multiplied with, lest float64 overflows
    double scale = 1, offset = 0; ///< applied before the value is stored
    double border = 0;            ///< stored value outside, where a table says how much of the weights is inside
    bool x_identity = false;

    VKT_HD bool reaches_border() const { return x.inside != nullptr || y.inside != nullptr || z.inside != nullptr; }
};

} // namespace vkt
