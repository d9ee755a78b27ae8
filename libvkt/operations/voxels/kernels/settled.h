// Which results of arithmetic may have been rounded twice, and what they are rounded once. For kernel sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/voxels/kernels/arithmetic_settled.h"
#include "libvkt/operations/voxels/kernels/arithmetic_values.h"
#include "libvkt/operations/voxels/kernels/exact_arithmetic.h"

#include <limits>
#include <type_traits>

namespace vkt::VKT_BACKEND {

/// False only if the real number that was rounded to v rounds to the same T as v does: unless v lies half-way between
/// two neighbours in T, both lie on the same side of whatever is half-way.
template <class T, class C> VKT_HD bool may_round_twice(C v) {
    [[maybe_unused]] C const size = v < C(0) ? -v : v;
    if constexpr (std::is_integral_v<T>) {
        constexpr C to_whole = sizeof(C) == 4 ? C(12582912.0) : C(6755399441055744.0); // as in round_to
        C const rest = v - ((v + to_whole) - to_whole);
        bool const half = rest == C(0.5) || rest == C(-0.5);
        // Doubles of this size may not have room for halves; beyond the second one all 64-bit types saturate.
        if constexpr (sizeof(T) == 8) return half || (size >= C(0x1p51) && size < C(0x1p65));
        return half;
    } else if constexpr (sizeof(T) >= sizeof(C)) {
        return false;
    } else if constexpr (std::is_same_v<T, Half>) {
        using Bits = std::conditional_t<sizeof(C) == 4, std::uint32_t, std::uint64_t>;
        constexpr Bits half = Bits{1} << (std::numeric_limits<C>::digits - 12);
        bool const middle = (detail::bits_as<Bits>(v) & (2 * half - 1)) == half;
        return middle || (size < C(0x1p-14) && size >= C(0x1p-25));
    } else {
        constexpr std::uint64_t half = std::uint64_t{1} << 28;
        bool const middle = (detail::bits_as<std::uint64_t>(v) & (2 * half - 1)) == half;
        return middle || (size < C(0x1p-126) && size >= C(0x1p-150));
    }
}

template <class C> VKT_HD void swap_values(C& a, C& b) {
    C const other = a;
    a = b;
    b = other;
}

/// True if r is a op b without rounding, which a real half-way value often is. False says nothing.
template <class C> VKT_HD bool is_exact(ArithmeticOp op, C a, C b, C r) {
    if (op == ArithmeticOp::sub) b = -b;
    if (op == ArithmeticOp::absdiff && a < b) swap_values(a, b);
    if (op == ArithmeticOp::absdiff) b = -b;
    if (op == ArithmeticOp::add || op == ArithmeticOp::sub ||
        op == ArithmeticOp::absdiff) { // the error of a sum (Knuth, TAOCP 2, 4.2.2)
        C const back = r - a;
        return (a - (r - back)) + (b - back) == C(0);
    }
    if (op == ArithmeticOp::div) swap_values(a, r); // a = r * b
    if constexpr (sizeof(C) == 4) {
        return static_cast<double>(a) * static_cast<double>(b) == static_cast<double>(r);
    } else {
        bool const has_room = (r < 0 ? -r : r) > 0x1p-900; // for the last bit of the product
        return has_room && __builtin_fma(a, b, -r) == 0;
    }
}

/// A finite voxel.
template <class T> VKT_HD ExactNumber exact_voxel(T voxel) {
    if constexpr (std::is_integral_v<T>) {
        bool negative = false;
        if constexpr (std::is_signed_v<T>) negative = voxel < 0;
        auto const bits = static_cast<std::uint64_t>(voxel);
        return {negative, negative ? 0 - bits : bits, 0};
    } else {
        auto const pattern = detail::bits_as<std::uint64_t>(static_cast<double>(voxel));
        auto const exponent = static_cast<int>(pattern >> 52 & 0x7ff);
        std::uint64_t const fraction = pattern & 0xfffffffffffff;
        return {(pattern >> 63) != 0, exponent == 0 ? fraction : fraction | std::uint64_t{1} << 52,
                (exponent == 0 ? 1 : exponent) - 1075};
    }
}

template <class T, class Counts> VKT_HD T store_exactly(ExactResult const& value, DataType type, Counts& losses) {
    if constexpr (std::is_integral_v<T>) {
        constexpr Int128 low = std::numeric_limits<T>::lowest(), high = std::numeric_limits<T>::max();
        Int128 const nearest = nearest_integer(value);
        losses.clipped += nearest < low || nearest > high;
        return static_cast<T>(nearest < low ? low : nearest > high ? high : nearest);
    } else {
        double const nearest = nearest_float(value, type);
        losses.clipped += is_clipped<T>(nearest);
        return round_to<T>(nearest);
    }
}

/// The result of a and b, of which u and v are the nearest doubles, rounded once.
template <class T, class Counts>
VKT_HD T settle(ArithmeticOp op, DataType type, double u, double v, ExactNumber a, ExactNumber b, Counts& losses) {
    bool const finite = u - u == 0 && v - v == 0, product = op == ArithmeticOp::mul;
    bool const division = op == ArithmeticOp::div;
    bool const picks = op == ArithmeticOp::min || op == ArithmeticOp::max;
    if (picks) {
        bool first = combined_of(op, u, v) == u;
        if (finite) first = op == ArithmeticOp::min ? compare(a, b) <= 0 : compare(a, b) >= 0;
        double const chosen = first ? u : v;
        if (finite || (chosen - chosen == 0 && u == u && v == v))
            return store_exactly<T>(exact_sum(first ? a : b, {}), type, losses);
    }
    if (is_comparison(op) && finite) return static_cast<T>(combined_of(op, static_cast<double>(compare(a, b)), 0.0));
    if (!finite || ((product || division) && (u == 0 || v == 0))) { // IEEE 754 knows no rounding here
        double const result = combined_of(op, u, v);
        losses.clipped += is_clipped<T>(result);
        losses.nan += is_lost_nan<T>(result);
        return round_to<T>(result);
    }
    if (op == ArithmeticOp::sub || op == ArithmeticOp::absdiff) b.negative = !b.negative;
    ExactResult result = product ? exact_product(a, b) : division ? exact_quotient(a, b) : exact_sum(a, b);
    if (op == ArithmeticOp::absdiff) result.negative = false;
    return store_exactly<T>(result, type, losses);
}

} // namespace vkt::VKT_BACKEND
