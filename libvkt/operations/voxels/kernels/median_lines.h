// Medians of lines of voxels along an axis.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Memory of a CPU's thread.
std::size_t median_line_bytes(DataType type, std::int64_t n);
/// Medians along an axis, of which `in` has all; NaN is left out and counted.
VKT_KERNEL(median_lines, (ConstView in, AnyView out, int axis, std::int64_t& nan, Execution const& execution),
           (in, out, axis, nan, execution))

} // namespace vkt
