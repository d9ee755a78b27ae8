// Voxels as integers that are ordered as their values are, for work that only compares: NaN above all numbers.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt::VKT_BACKEND {

// Of each size the integer type whose least and greatest instructions are the oldest.
template <std::size_t bytes> struct OrderKeyOf;
template <> struct OrderKeyOf<1> { using type = std::uint8_t; };
template <> struct OrderKeyOf<2> { using type = std::int16_t; };
template <> struct OrderKeyOf<4> { using type = std::int32_t; };
template <> struct OrderKeyOf<8> { using type = std::int64_t; };
template <class T> using OrderKey = typename OrderKeyOf<sizeof(T)>::type;

/// Calls f(K{}) with the type of the keys of voxels of this type.
template <class F> void with_order_key(DataType type, F&& f) {
    for_each_size(size_of(type), [&]<class U>(U) { f(OrderKey<U>{}); });
}

/// The key of a voxel's bits: voxels compare as their keys do, -0 below 0, all NaN above all numbers.
template <class T, class K> VKT_HD K to_key(K bits) {
    using U = std::make_unsigned_t<K>;
    constexpr U top = U(U(1) << (8 * sizeof(K) - 1));
    if constexpr (std::is_integral_v<T>) {
        return std::is_signed_v<T> == std::is_signed_v<K> ? bits : K(U(bits) ^ top);
    } else {
        constexpr K infinity = sizeof(K) == 2   ? K(0x7c00)
                               : sizeof(K) == 4 ? K(0x7f800000)
                                                : K(0x7ff0000000000000LL & static_cast<long long>(~top));
        K const magnitude = K(bits & K(U(~top)));
        bits = magnitude > infinity ? magnitude : bits; // NaN without its sign
        return bits < 0 ? K(bits ^ K(U(~top))) : bits;
    }
}
/// The bits that have this key.
template <class T, class K> VKT_HD K from_key(K key) {
    using U = std::make_unsigned_t<K>;
    constexpr U top = U(U(1) << (8 * sizeof(K) - 1));
    if constexpr (std::is_integral_v<T>)
        return std::is_signed_v<T> == std::is_signed_v<K> ? key : K(U(key) ^ top);
    else
        return key < 0 ? K(key ^ K(U(~top))) : key;
}

/// Keys of n voxels of a type with as many bytes as K; `to` may be where they lie.
template <class K> inline void load_keys(DataType type, std::byte const* from, K* to, std::int64_t n) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) == sizeof(K)) {
            if (reinterpret_cast<std::byte const*>(to) != from)
                std::memcpy(to, from, static_cast<std::size_t>(n) * sizeof(K));
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) to[i] = to_key<T>(to[i]);
        }
    });
}
/// The voxels that have these keys.
template <class K> inline void store_keys(DataType type, K const* from, std::byte* to, std::int64_t n) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) == sizeof(K)) {
            auto* const voxels = reinterpret_cast<K*>(to);
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) voxels[i] = from_key<T>(from[i]);
        }
    });
}

} // namespace vkt::VKT_BACKEND
