// Cells of any storage type: loading into a compute type, storing with rounding and saturation.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/type_dispatch.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace vkt {

/// True if interpolation of this type computes in double: float would lose bits of its values.
inline bool computes_in_double(DataType type) {
    return type == DataType::uint32 || type == DataType::int32 || type == DataType::uint64 || type == DataType::int64 ||
           type == DataType::float64;
}

/// The cell that holds a value: floats convert, integers round half to even and saturate, NaN becomes 0.
template <class T, class C> inline T store_cell(C value) {
    if constexpr (std::is_same_v<T, Half> || std::is_floating_point_v<T>) {
        return static_cast<T>(value);
    } else {
        C const low = static_cast<C>(std::numeric_limits<T>::lowest());
        C const high = static_cast<C>(std::numeric_limits<T>::max());
        C const rounded = std::nearbyint(value);
        // The largest 32- and 64-bit integers round up when they become C; comparing with >= keeps the cast in range.
        if (rounded >= high) return std::numeric_limits<T>::max();
        if (rounded > low) return static_cast<T>(rounded);
        return rounded <= low ? std::numeric_limits<T>::lowest() : T{0};
    }
}

/// 64-bit integers, most of which double does not hold.
template <class T> inline constexpr bool is_wide_cell = std::is_integral_v<T> && sizeof(T) == 8;

/// a - b of such integers, rounded only once.
template <class T> double cell_difference(T a, T b) {
    static_assert(is_wide_cell<T>);
    auto const u = static_cast<std::uint64_t>(a), v = static_cast<std::uint64_t>(b);
    return a >= b ? static_cast<double>(u - v) : -static_cast<double>(v - u);
}

/// Such an integer plus a difference, rounded half to even and saturated.
template <class T> T cell_beyond(T from, double difference) {
    static_assert(is_wide_cell<T>);
    double const whole = std::nearbyint(difference), size = std::abs(whole);
    auto const base = static_cast<std::uint64_t>(from);
    std::uint64_t const step = size >= 0x1p64 ? ~std::uint64_t{0} : static_cast<std::uint64_t>(size);
    if (whole < 0) {
        T const lowest = std::numeric_limits<T>::lowest();
        return step > base - static_cast<std::uint64_t>(lowest) ? lowest : static_cast<T>(base - step);
    }
    T const most = std::numeric_limits<T>::max();
    return step > static_cast<std::uint64_t>(most) - base ? most : static_cast<T>(base + step);
}

} // namespace vkt
