// Pieces of rows between their storage type and a compute type, for kernels that compute a row at a time on the CPU.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

namespace vkt::VKT_BACKEND {

/// Voxels of a row worked on at a time: two such pieces in double stay in the first cache.
inline constexpr std::int64_t row_piece = 1024;

/// to[i] = in[i], C is float or double; integers of more bits than C's fraction are rounded.
template <class C>
void load_row(DataType type, std::byte const* from, C* to, std::int64_t n);

/// to[i] = from[i], rounded half to even and saturated; says what was clipped and what was NaN.
template <class C>
Tally store_row(DataType type, C const* from, std::byte* to, std::int64_t n);

extern template void load_row(DataType, std::byte const*, float*, std::int64_t);
extern template void load_row(DataType, std::byte const*, double*, std::int64_t);
extern template Tally store_row(DataType, float const*, std::byte*, std::int64_t);
extern template Tally store_row(DataType, double const*, std::byte*, std::int64_t);

/// True if float holds every value of the type, and rounding from float to the type is as good as from double.
inline bool float_suffices(DataType type) {
    return size_of(type) <= 2 || type == DataType::float32;
}

} // namespace vkt::VKT_BACKEND
