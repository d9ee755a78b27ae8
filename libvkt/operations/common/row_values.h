// Reading voxels as numbers, a row at a time, for reports.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

namespace vkt {

/// The stored values of row (y, z) of a host view, as double; 64-bit integers are rounded to 53 bits.
void read_row(ConstView view, std::int64_t y, std::int64_t z, double* to);

} // namespace vkt
