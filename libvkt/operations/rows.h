// Pieces of rows between their storage type and double, for kernels that compute a row at a time on the CPU.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

namespace vkt::VKT_BACKEND {

/// Voxels of a row worked on at a time: two such pieces in double stay in the first cache.
inline constexpr std::int64_t row_piece = 1024;

/// to[i] = in[i]; 64-bit integers are rounded to 53 bits.
void load_row(DataType type, std::byte const* from, double* to, std::int64_t n);

/// out[i] = scale * from[i] + offset, rounded half to even and saturated; says what was clipped and what was NaN.
Tally store_row(DataType type, double const* from, std::byte* to, std::int64_t n, double scale = 1, double offset = 0);

} // namespace vkt::VKT_BACKEND
