// Pieces of rows between their storage type and a compute type: what drivers on the CPU work on, in the first cache.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt::VKT_BACKEND {

/// Voxels of a row worked on at a time: a few such pieces in double stay in the first cache.
inline constexpr std::int64_t row_piece = 1024;

/// to[i] = in[i] for n voxels. C is float or double, which round integers of more bits than they
/// have digits, or Int128, which takes integers only.
template <class C> void load_row(DataType type, std::byte const* from, C* to, std::int64_t n);

/// to[i] = from[i] for n voxels, rounded half to even and saturated; says what was lost.
template <class C> Losses store_row(DataType type, C const* from, std::byte* to, std::int64_t n);

extern template void load_row(DataType, std::byte const*, float*, std::int64_t);
extern template void load_row(DataType, std::byte const*, double*, std::int64_t);
extern template void load_row(DataType, std::byte const*, Int128*, std::int64_t);
extern template Losses store_row(DataType, float const*, std::byte*, std::int64_t);
extern template Losses store_row(DataType, double const*, std::byte*, std::int64_t);
extern template Losses store_row(DataType, Int128 const*, std::byte*, std::int64_t);

/// True if float holds every value of the type, and rounding from float to the type is as good as from double.
inline bool float_suffices(DataType type) { return size_of(type) <= 2 || type == DataType::float32; }

/// True if voxels of the type are computed with as they lie.
template <class C> bool is_stored_as(DataType type) {
    if constexpr (std::is_same_v<C, Int128>) return false;
    return type == (std::is_same_v<C, float> ? DataType::float32 : DataType::float64);
}

} // namespace vkt::VKT_BACKEND
