// Comparing voxels with two numbers.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/common/number.h"

namespace vkt {

/// What is inside, in physical values.
struct ThresholdRule {
    ValueMap map;
    Number low, high;
    bool above_low = false, below_high = false; ///< the end itself is outside
};

/// out = 1 inside, 0 elsewhere, in uint8; NaN is outside and counted as undefined.
VKT_KERNEL(threshold_box,
           (ConstView in, AnyView out, ThresholdRule const& rule, Losses& losses, Execution const& execution),
           (in, out, rule, losses, execution))

} // namespace vkt
