// Changing the type of voxels, and mapping a range of values linearly.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/wide.h"
#include "libvkt/kernel/numeric.h"

#include <cstdint>
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

/// What decides which types hold stored values. Of finite values, but for the last two; distances are 0 if there are
/// none.
struct TypeFit {
    FiniteExtremes extremes;
    double off_whole = 0;                ///< largest distance from a whole number
    double off_half = 0, off_single = 0; ///< from the nearest float16 and float32; infinite beyond them
    std::uint64_t step = 0;              ///< greatest common divisor of differences; 0 if there are none, 1 if unknown
    bool nan = false, infinite = false;
};

VKT_KERNEL(find_fit, (ConstView in, TypeFit& found, Execution const& execution), (in, found, execution))
VKT_KERNEL(find_extremes, (ConstView in, FiniteExtremes& found, Execution const& execution), (in, found, execution))
VKT_KERNEL(convert_values, (ConstView in, AnyView out, Losses& losses, Execution const& execution),
           (in, out, losses, execution))
VKT_KERNEL(convert_range, (ConstView in, AnyView out, LinearMap const& map, Losses& losses, Execution const& execution),
           (in, out, map, losses, execution))

} // namespace vkt
