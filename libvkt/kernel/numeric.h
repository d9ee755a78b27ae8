// Arithmetic that every kernel shares: compute types, type dispatch, rounding with saturation, fused multiply-add.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/losses.h"
#include "libvkt/core/type_dispatch.h"
#include "libvkt/core/wide.h"
#include "libvkt/kernel/backend.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace vkt {

/// The type kernels compute in for voxels stored as T: float, or double where 32-bit integers or float64 ask for it.
template <class T> struct Compute {
    using type =
        std::conditional_t<std::is_same_v<T, Half> || std::is_same_v<T, float> || sizeof(T) <= 2, float, double>;
};
template <class T> using compute_t = typename Compute<T>::type;

/// One voxel of any type, from the first byte on.
using VoxelBytes = std::array<std::byte, 8>;

namespace VKT_BACKEND {

/// Calls f(C{}) with the type that kernels compute in for voxels of this type, see Compute.
template <class F> void with_compute_type(DataType type, F&& f) {
    if (size_of(type) <= 2 || type == DataType::float32) return f(float{});
    f(double{});
}

/// Calls f(U{}) with the unsigned type of that many bytes: permutations do not look at values.
template <class F> void for_each_size(std::size_t bytes, F&& f) {
    switch (bytes) {
    case 1:
        return f(std::uint8_t{});
    case 2:
        return f(std::uint16_t{});
    case 4:
        return f(std::uint32_t{});
    default:
        return f(std::uint64_t{});
    }
}

/// a * b + c, fused where the back end has it. The compiler itself never contracts, so results depend on nothing else.
VKT_HD float madd(float a, float b, float c) {
#if defined(__CUDACC__) || defined(__FMA__)
    return __builtin_fmaf(a, b, c);
#else
    return a * b + c;
#endif
}
VKT_HD double madd(double a, double b, double c) {
#if defined(__CUDACC__) || defined(__FMA__)
    return __builtin_fma(a, b, c);
#else
    return a * b + c;
#endif
}

/// The storage value nearest to v: halves to even, saturating, NaN to 0 for integers. Half overflows to infinity.
template <class T, class C> VKT_HD T round_to(C v) {
    if constexpr (std::is_same_v<C, Int128>) {
        if constexpr (std::is_same_v<T, Half>)
            return Half(static_cast<float>(v)); // more than twice the digits of a half: no double rounding below 2^16
        else if constexpr (std::is_floating_point_v<T>)
            return static_cast<T>(v);
        else if (v < static_cast<Int128>(std::numeric_limits<T>::lowest()))
            return std::numeric_limits<T>::lowest();
        else
            return v > static_cast<Int128>(std::numeric_limits<T>::max()) ? std::numeric_limits<T>::max()
                                                                          : static_cast<T>(v);
    } else if constexpr (std::is_same_v<T, Half>) {
        return Half(v);
    } else if constexpr (std::is_floating_point_v<T>) {
        return static_cast<T>(v);
    } else if constexpr (std::is_integral_v<C>) {
        if constexpr (std::is_signed_v<C> && !std::is_signed_v<T>) {
            if (v < 0) return T(0);
        } else if constexpr (std::is_signed_v<C>) {
            if (v < C(0) && static_cast<long long>(v) < static_cast<long long>(std::numeric_limits<T>::lowest()))
                return std::numeric_limits<T>::lowest();
        }
        if (v > C(0) &&
            static_cast<unsigned long long>(v) > static_cast<unsigned long long>(std::numeric_limits<T>::max()))
            return std::numeric_limits<T>::max();
        return static_cast<T>(v);
    } else if constexpr (sizeof(T) <= 2 && sizeof(C) == 4) {
        // 1.5 * 2^23 pushes the integer into the low bits of the sum, rounded half to even; it vectorises everywhere.
        C const lowest = static_cast<C>(std::numeric_limits<T>::lowest());
        C const highest = static_cast<C>(std::numeric_limits<T>::max());
        if constexpr (std::is_signed_v<T>) v = v == v ? v : C(0); // NOLINT(misc-redundant-expression): NaN
        v = v > lowest ? v : lowest;                              // NaN becomes `lowest`, which is 0 for unsigned types
        v = v < highest ? v : highest;
        return static_cast<T>(detail::bits_as<std::int32_t>(v + 12582912.0f));
    } else if constexpr (sizeof(T) <= 4) {
        double w = static_cast<double>(v);
        double const lowest = static_cast<double>(std::numeric_limits<T>::lowest());
        double const highest = static_cast<double>(std::numeric_limits<T>::max());
        if constexpr (std::is_signed_v<T>) w = w == w ? w : 0.0;
        w = w > lowest ? w : lowest;
        w = w < highest ? w : highest;
        return static_cast<T>(detail::bits_as<std::int64_t>(w + 6755399441055744.0));
    } else {
        double const w = static_cast<double>(v);
        double const end = std::is_signed_v<T> ? 0x1p63 : 0x1p64; // one beyond the largest value
        double const lowest = std::is_signed_v<T> ? -0x1p63 : 0.0;
        if (!(w == w)) return T(0);
        if (w >= end) return std::numeric_limits<T>::max();
        if (w <= lowest) return std::numeric_limits<T>::lowest();
        return static_cast<T>(__builtin_rint(w));
    }
}

/// True if round_to<T>(v) saturates, that is if the rounded value lies outside of T; false for NaN and for floats,
/// except that a finite value may become an infinite Half.
template <class T, class C> VKT_HD bool is_clipped(C v) {
    if constexpr (std::is_same_v<C, Int128>) {
        if constexpr (std::is_same_v<T, Half>)
            return v >= 65520 || v <= -65520;
        else if constexpr (std::is_floating_point_v<T>)
            return false;
        else
            return v < static_cast<Int128>(std::numeric_limits<T>::lowest()) ||
                   v > static_cast<Int128>(std::numeric_limits<T>::max());
    } else if constexpr (std::is_same_v<T, Half>) {
        C const magnitude = v < C(0) ? -v : v;
        return magnitude >= C(65520) && magnitude <= std::numeric_limits<C>::max();
    } else if constexpr (std::is_floating_point_v<T>) {
        if constexpr (sizeof(C) > sizeof(T)) {
            C const magnitude = v < C(0) ? -v : v;
            return magnitude >= C(0x1.ffffffp127) && magnitude <= std::numeric_limits<C>::max();
        } else {
            return false;
        }
    } else if constexpr (std::is_integral_v<C>) {
        if constexpr (std::is_signed_v<C> && !std::is_signed_v<T>) {
            if (v < 0) return true;
        } else if constexpr (std::is_signed_v<C>) {
            if (v < C(0)) return static_cast<long long>(v) < static_cast<long long>(std::numeric_limits<T>::lowest());
        }
        return static_cast<unsigned long long>(v) > static_cast<unsigned long long>(std::numeric_limits<T>::max());
    } else {
        // The largest value is odd, so a tie above it rounds away from it; the smallest is even, so a tie below stays.
        using Wide = std::conditional_t<sizeof(T) >= 4, double, C>;
        Wide const w = static_cast<Wide>(v);
        return w >= static_cast<Wide>(std::numeric_limits<T>::max()) + Wide(0.5) ||
               w < static_cast<Wide>(std::numeric_limits<T>::lowest()) - Wide(0.5);
    }
}

/// True if v is NaN and T cannot say so.
template <class T, class C> VKT_HD bool is_lost_nan(C v) {
    if constexpr (std::is_integral_v<T> && std::is_floating_point_v<C>)
        return v != v; // NOLINT(misc-redundant-expression): NaN
    else
        return false;
}

/// The voxel that stores a value as round_to does.
inline VoxelBytes voxel_bytes(DataType type, double value) {
    VoxelBytes voxel{};
    with_type(type, [&]<class T>(T) {
        T const stored = round_to<T>(value);
        std::memcpy(voxel.data(), &stored, sizeof stored);
    });
    return voxel;
}

} // namespace VKT_BACKEND
} // namespace vkt
