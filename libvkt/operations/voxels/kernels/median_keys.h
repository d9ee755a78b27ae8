// The median of a line from the keys of its voxels, which are numbers in the order of the values. For kernel sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/kernel/order.h"

namespace vkt::VKT_BACKEND {

/// Keys as unsigned numbers in the same order.
template <class K> using UnsignedKey = std::make_unsigned_t<K>;
template <class K>
inline constexpr UnsignedKey<K> key_offset = std::is_signed_v<K>
                                                 ? static_cast<UnsignedKey<K>>(UnsignedKey<K>(1) << (8 * sizeof(K) - 1))
                                                 : UnsignedKey<K>(0);
template <class K> VKT_HD UnsignedKey<K> unsigned_key(K key) {
    return static_cast<UnsignedKey<K>>(static_cast<UnsignedKey<K>>(key) ^ key_offset<K>);
}
template <class K> VKT_HD K key_of(UnsignedKey<K> key) { return static_cast<K>(key ^ key_offset<K>); }

/// The mean of two voxels as their type has it: of integers half to even, of floats without overflow.
template <class T> VKT_HD T middle(T a, T b) {
    if constexpr (std::is_integral_v<T>) {
        Int128 const sum = static_cast<Int128>(a) + static_cast<Int128>(b);
        Int128 const low = (sum - (sum & 1)) / 2; // towards the lower one
        return static_cast<T>((sum & 1) != 0 && (low & 1) != 0 ? low + 1 : low);
    } else if constexpr (std::is_same_v<T, double>) {
        double const sum = a + b;
        return a == b           ? a
               : sum - sum == 0 ? sum / 2
                                : a / 2 + b / 2; // NOLINT(misc-redundant-expression): beyond double
    } else {
        return static_cast<T>((static_cast<double>(a) + static_cast<double>(b)) / 2);
    }
}

/// The voxel in the middle, of two the mean: `lower` and `upper` are the same key of an odd number.
template <class T, class K> VKT_HD T median_of(K lower, K upper, bool odd) {
    T const above = detail::bits_as<T>(from_key<T>(upper));
    return odd ? above : middle(detail::bits_as<T>(from_key<T>(lower)), above);
}

} // namespace vkt::VKT_BACKEND
