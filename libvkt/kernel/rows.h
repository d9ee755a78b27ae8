// Pieces of rows between the type they are stored in and the type they are computed in: what lets CPU drivers work on
// any type without being compiled for each.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/kernel/backend.h"
#include "libvkt/kernel/losses.h"

#include <cstddef>
#include <cstdint>

namespace vkt::VKT_BACKEND {

/// Voxels of a row worked on at a time: a few such pieces in double stay in the first cache.
inline constexpr std::int64_t row_piece = 1024;

/// to[i] = from[i]; C is float or double. Integers of more bits than C's fraction are rounded.
template <class C> void load_row(DataType type, std::byte const* from, C* to, std::int64_t n);

/// to[i] = from[i], rounded half to even and saturated, NaN as 0 in integers; tells what was lost.
template <class C> Losses store_row(DataType type, C const* from, std::byte* to, std::int64_t n);

extern template void load_row(DataType, std::byte const*, float*, std::int64_t);
extern template void load_row(DataType, std::byte const*, double*, std::int64_t);
extern template Losses store_row(DataType, float const*, std::byte*, std::int64_t);
extern template Losses store_row(DataType, double const*, std::byte*, std::int64_t);

} // namespace vkt::VKT_BACKEND
