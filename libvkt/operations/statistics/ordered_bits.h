// Bits of voxels, arranged to ascend with their values, and back.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/half.h"

#include <cstdint>
#include <type_traits>

namespace vkt {

template <class T>
using OrderedBits =
    std::conditional_t<sizeof(T) == 1, std::uint8_t,
                       std::conditional_t<sizeof(T) == 2, std::uint16_t,
                                          std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;

template <class T>
inline constexpr OrderedBits<T> top_bit = static_cast<OrderedBits<T>>(OrderedBits<T>{1} << (8 * sizeof(T) - 1));

/// -0 comes with 0, so that equal values have equal bits.
template <class T> [[gnu::always_inline]] constexpr OrderedBits<T> ordered_bits(T value) {
    using P = OrderedBits<T>;
    auto const bits = detail::bits_as<P>(value);
    if constexpr (std::is_integral_v<T>)
        return std::is_signed_v<T> ? static_cast<P>(bits ^ top_bit<T>) : bits;
    else if (bits == top_bit<T>)
        return top_bit<T>;
    else
        return (bits & top_bit<T>) != 0 ? static_cast<P>(~bits) : static_cast<P>(bits | top_bit<T>);
}

template <class T> [[gnu::always_inline]] constexpr T value_of_ordered(std::uint64_t ordered) {
    using P = OrderedBits<T>;
    auto const bits = static_cast<P>(ordered);
    if constexpr (std::is_integral_v<T>)
        return static_cast<T>(std::is_signed_v<T> ? static_cast<P>(bits ^ top_bit<T>) : bits);
    else
        return detail::bits_as<T>((bits & top_bit<T>) != 0 ? static_cast<P>(bits & ~top_bit<T>)
                                                           : static_cast<P>(~bits));
}

template <class T> [[gnu::always_inline]] constexpr bool is_finite_voxel(T value) {
    if constexpr (std::is_integral_v<T>)
        return true;
    else if constexpr (std::is_same_v<T, Half>)
        return (value.bits & 0x7c00u) != 0x7c00u;
    else
        return value - value == T(0); // NOLINT(misc-redundant-expression): neither infinite nor NaN
}

} // namespace vkt
