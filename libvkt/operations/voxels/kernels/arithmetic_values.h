// What each operation of arith makes of two values.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/arithmetic.h"

#include <cmath>

namespace vkt::VKT_BACKEND {

/// Operations that yield 0 or 1.
VKT_HD bool is_comparison(ArithmeticOp op) { return op >= ArithmeticOp::gt && op <= ArithmeticOp::not_; }

inline constexpr Int128 huge = (Int128{1} << 126) - 1 + (Int128{1} << 126); ///< the largest: saturates every type

/// a / b for b != 0, halves to even.
VKT_CALLED Int128 whole_quotient(Int128 a, Int128 b) {
    Int128 const q = a / b, rest = a - q * b;
    Int128 const twice = (rest < 0 ? -rest : rest) * 2, size = b < 0 ? -b : b;
    if (twice < size || (twice == size && (q & 1) == 0)) return q;
    return (a < 0) == (b < 0) ? q + 1 : q - 1;
}

/// Products of voxels and numbers below 2^99 stay below 2^126 or saturate every type.
VKT_CALLED Int128 whole_product(Int128 a, Int128 b) {
    double const size = static_cast<double>(a) * static_cast<double>(b);
    if (size > 0x1p125 || size < -0x1p125) return size > 0 ? huge : -huge;
    return a * b;
}

// Functions whose code is long: one copy of each, not one for every voxel of a pack.
VKT_CALLED double pow_of(double u, double v) { return std::pow(u, v); }
VKT_CALLED double exp_of(double u) { return std::exp(u); }
VKT_CALLED double log_of(double u) { return std::log(u); }

/// op of (u, v); operations on one value take the first. IEEE 754 for floating values; min and max hand NaN on.
template <ArithmeticOp op, class C> struct Combined {
    static VKT_HD C of(C u, C v) {
        constexpr bool whole = std::is_same_v<C, Int128>;
        using enum ArithmeticOp;
        if constexpr (op == add) return u + v;
        if constexpr (op == sub) return u - v;
        if constexpr (op == mul) {
            if constexpr (whole)
                return whole_product(u, v);
            else
                return u * v;
        }
        if constexpr (op == div) {
            if constexpr (whole)
                return v == 0 ? (u > 0 ? huge : u < 0 ? -huge : Int128{0}) : whole_quotient(u, v);
            else
                return u / v;
        }
        if constexpr (op == min) return u < v || u != u ? u : v;
        if constexpr (op == max) return u > v || u != u ? u : v;
        if constexpr (op == absdiff) return (u < v ? v - u : u - v) + C(0); // -0 becomes 0
        if constexpr (op == gt) return u > v ? C(1) : C(0);
        if constexpr (op == ge) return u >= v ? C(1) : C(0);
        if constexpr (op == lt) return u < v ? C(1) : C(0);
        if constexpr (op == le) return u <= v ? C(1) : C(0);
        if constexpr (op == eq) return u == v ? C(1) : C(0);
        if constexpr (op == ne) return u != v ? C(1) : C(0);
        if constexpr (op == and_) return u != C(0) && v != C(0) ? C(1) : C(0);
        if constexpr (op == or_) return u != C(0) || v != C(0) ? C(1) : C(0);
        if constexpr (op == not_) return u == C(0) ? C(1) : C(0);
        if constexpr (op == abs) return u < C(0) || u == C(0) ? C(0) - u : u; // -0 becomes 0
        if constexpr (op == neg) return -u;
        if constexpr (!whole) {
            if constexpr (op == pow) return static_cast<C>(pow_of(static_cast<double>(u), static_cast<double>(v)));
            if constexpr (op == sqrt) return std::sqrt(u);
            if constexpr (op == exp) return static_cast<C>(exp_of(static_cast<double>(u)));
            if constexpr (op == log) return static_cast<C>(log_of(static_cast<double>(u)));
        }
        return u;
    }
};

/// Operations that have no value for some numbers.
VKT_HD bool has_poles(ArithmeticOp op) {
    return op == ArithmeticOp::pow || op == ArithmeticOp::sqrt || op == ArithmeticOp::log;
}
/// Operations of a few instructions.
VKT_HD bool is_short(ArithmeticOp op) {
    return op != ArithmeticOp::pow && op != ArithmeticOp::exp && op != ArithmeticOp::log;
}
/// Calls f.template operator()<op>() for those, clamp and where excepted.
template <class F> VKT_HD void with_short_op(ArithmeticOp op, F&& f) {
    using enum ArithmeticOp;
    switch (op) {
    case add:
        return f.template operator()<add>();
    case sub:
        return f.template operator()<sub>();
    case mul:
        return f.template operator()<mul>();
    case div:
        return f.template operator()<div>();
    case min:
        return f.template operator()<min>();
    case max:
        return f.template operator()<max>();
    case absdiff:
        return f.template operator()<absdiff>();
    case gt:
        return f.template operator()<gt>();
    case ge:
        return f.template operator()<ge>();
    case lt:
        return f.template operator()<lt>();
    case le:
        return f.template operator()<le>();
    case eq:
        return f.template operator()<eq>();
    case ne:
        return f.template operator()<ne>();
    case and_:
        return f.template operator()<and_>();
    case or_:
        return f.template operator()<or_>();
    case not_:
        return f.template operator()<not_>();
    case abs:
        return f.template operator()<abs>();
    case neg:
        return f.template operator()<neg>();
    case sqrt:
        return f.template operator()<sqrt>();
    default:
        return;
    }
}
/// The same for all.
template <class F> VKT_HD void with_op(ArithmeticOp op, F&& f) {
    using enum ArithmeticOp;
    if (op == pow) return f.template operator()<pow>();
    if (op == exp) return f.template operator()<exp>();
    if (op == log) return f.template operator()<log>();
    with_short_op(op, f);
}

/// The same for an operation that is known only when it runs: called, since packs of voxels times operations are more
/// code than a compiler takes well.
template <class C> VKT_CALLED C combined_of(ArithmeticOp op, C u, C v) {
    C value{};
    with_op(op, [&]<ArithmeticOp o>() { value = Combined<o, C>::of(u, v); });
    return value;
}

} // namespace vkt::VKT_BACKEND
