// The types in which rays find voxels, and where one of them is chosen: at the innermost look into the volume, so that
// all that surrounds it is compiled once.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/host_device.h"

#include <cstdint>
#include <type_traits>

namespace vkt::render {

/// Storage types that rays can sample; the others are converted to float before.
enum class LatticeType : std::uint8_t { uint8, uint16, int16, float32 };

/// Calls f(T{}) with the type and returns what it returns; inlined always, as with_type() is.
template <class F> [[gnu::always_inline]] constexpr decltype(auto) with_lattice_type(LatticeType type, F&& f) {
    switch (type) {
    case LatticeType::uint8:
        return f(std::uint8_t{});
    case LatticeType::uint16:
        return f(std::uint16_t{});
    case LatticeType::int16:
        return f(std::int16_t{});
    case LatticeType::float32:
        break;
    }
    return f(float{});
}

/// In place of a type: voxels say which they are when they are looked at. Beside what a look costs a CPU this is
/// nothing, as it always takes the same way; on GPUs, where it would take registers, types are known before.
struct AnyVoxel {};

/// Calls f(V{}): V is T or, of AnyVoxel, what `type` says.
template <class T, class F> VKT_HD constexpr decltype(auto) with_voxel_type([[maybe_unused]] LatticeType type, F&& f) {
    if constexpr (std::is_same_v<T, AnyVoxel>)
        return with_lattice_type(type, f);
    else
        return f(T{});
}

} // namespace vkt::render
