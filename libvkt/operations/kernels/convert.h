// Changing the type of voxels, and mapping a range of values linearly.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/wide.h"
#include "libvkt/kernel/numeric.h"

#include <limits>

namespace vkt {

/// stored = (v * scale - low * scale) * factor + to_low for v limited to [least, most]. All but to_low count from
/// `base`. The scale is a power of two that keeps differences of the largest doubles finite, and 1 for all others.
struct LinearMap {
    Int128 base = 0;
    double low = 0, scale = 1, factor = 1, to_low = 0, least = 0, most = 0;
};

/// The finite extremes of stored values, low > high if there are none. Integers also have them exactly.
struct FiniteExtremes {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    Int128 whole_low = 0, whole_high = 0;
};

VKT_KERNEL(find_extremes, (ConstView in, FiniteExtremes& found, Execution const& execution), (in, found, execution))
VKT_KERNEL(convert_values, (ConstView in, AnyView out, Losses& losses, Execution const& execution),
           (in, out, losses, execution))
VKT_KERNEL(convert_range, (ConstView in, AnyView out, LinearMap const& map, Losses& losses, Execution const& execution),
           (in, out, map, losses, execution))

} // namespace vkt
