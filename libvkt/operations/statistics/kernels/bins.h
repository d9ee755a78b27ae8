// Counting voxels in bins.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/wide.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Bins of equal width from base + low on; of width 0, one bin for every whole number from base on.
struct BinRule {
    Int128 base = 0; ///< integers: what values are counted from, exactly
    double low = 0, width = 0, per_unit = 0;
    std::int64_t count = 1;
};

/// Adds the finite voxels to their bins, none of which they lie outside of but by rounding.
VKT_KERNEL(count_bins, (ConstView in, BinRule const& rule, std::int64_t* counters, Execution const& execution),
           (in, rule, counters, execution))

} // namespace vkt
