// What the operations of expressions do to values, for every back end: one functor each.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/voxels/expression.h"
#include "libvkt/operations/voxels/kernels/functions.h"

#include <cmath>
#include <limits>

namespace vkt::VKT_BACKEND {

/// The rest of a / b with the sign of a, exact.
template <class C> VKT_HD C rest_of(C a, C b) {
    if constexpr (sizeof(C) == 4) {
        // Below 2^29 the product of the whole quotient and b fits a double; the quotient may have been rounded up.
        double const u = std::fabs(static_cast<double>(a)), v = std::fabs(static_cast<double>(b)), q = u / v;
        if (q < 0x1p29) {
            double const rest = u - std::trunc(q) * v;
            return std::copysign(static_cast<C>(rest < 0 ? rest + v : rest), a);
        }
    }
    return std::fmod(a, b);
}

/// Calls use(f) with what an operation of one operand does. Angles may be of any size.
template <class C, class Use> VKT_HD void with_one(Op op, Use&& use) {
    switch (op) {
    case Op::neg:
        return use([](C u) { return -u; });
    case Op::abs:
        return use([](C u) { return std::fabs(u); });
    case Op::sqrt:
        return use([](C u) { return std::sqrt(u); });
    case Op::exp:
        return use([](C u) { return exponential_of(static_cast<double>(u)); });
    case Op::log:
        return use([](C u) { return logarithm_of(static_cast<double>(u)); });
    case Op::log10:
        return use([](C u) { return std::log10(static_cast<double>(u)); });
    case Op::log2:
        return use([](C u) { return std::log2(static_cast<double>(u)); });
    case Op::exp2:
        return use([](C u) { return std::exp2(static_cast<double>(u)); });
    case Op::cbrt:
        return use([](C u) { return std::cbrt(static_cast<double>(u)); });
    case Op::sin:
        return use([](C u) {
            return std::fabs(u) < C(most_angle) ? sine_of(static_cast<double>(u), 0) : std::sin(static_cast<double>(u));
        });
    case Op::cos:
        return use([](C u) {
            return std::fabs(u) < C(most_angle) ? sine_of(static_cast<double>(u), 1) : std::cos(static_cast<double>(u));
        });
    case Op::tan:
        return use([](C u) {
            return std::fabs(u) < C(most_angle) ? tangent_of(static_cast<double>(u)) : std::tan(static_cast<double>(u));
        });
    case Op::asin:
        return use([](C u) { return std::asin(static_cast<double>(u)); });
    case Op::acos:
        return use([](C u) { return std::acos(static_cast<double>(u)); });
    case Op::sinh:
        return use([](C u) { return std::sinh(static_cast<double>(u)); });
    case Op::cosh:
        return use([](C u) { return std::cosh(static_cast<double>(u)); });
    case Op::tanh:
        return use([](C u) { return std::tanh(static_cast<double>(u)); });
    case Op::erf:
        return use([](C u) { return std::erf(static_cast<double>(u)); });
    case Op::atan:
        return use([](C u) { return std::atan(static_cast<double>(u)); });
    case Op::floor:
        return use([](C u) { return std::floor(u); });
    case Op::ceil:
        return use([](C u) { return std::ceil(u); });
    case Op::round:
        return use([](C u) { return std::nearbyint(u); });
    case Op::trunc:
        return use([](C u) { return std::trunc(u); });
    case Op::sign:
        return use([](C u) { return u > C(0) ? C(1) : u < C(0) ? C(-1) : u; });
    case Op::not_:
        return use([](C u) { return u == C(0) ? C(1) : C(0); });
    case Op::isnan:
        return use([](C u) { return u != u ? C(1) : C(0); }); // NOLINT(misc-redundant-expression): NaN
    case Op::isinf:
        return use([](C u) { return std::fabs(u) > std::numeric_limits<C>::max() ? C(1) : C(0); });
    case Op::isfinite:
        return use([](C u) { return std::fabs(u) <= std::numeric_limits<C>::max() ? C(1) : C(0); });
    default: // a value as it is
        return use([](C u) { return u; });
    }
}

/// The same for two operands.
template <class C, class Use> VKT_HD void with_two(Op op, Use&& use) {
    switch (op) {
    case Op::add:
        return use([](C u, C v) { return u + v; });
    case Op::sub:
        return use([](C u, C v) { return u - v; });
    case Op::mul:
        return use([](C u, C v) { return u * v; });
    case Op::div:
        return use([](C u, C v) { return u / v; });
    case Op::min:
        return use([](C u, C v) { return u < v || u != u ? u : v; }); // NOLINT(misc-redundant-expression): NaN
    case Op::max:
        return use([](C u, C v) { return u > v || u != u ? u : v; }); // NOLINT(misc-redundant-expression): NaN
    case Op::pow:
        return use([](C u, C v) { return std::pow(static_cast<double>(u), static_cast<double>(v)); });
    case Op::atan2:
        return use([](C u, C v) { return std::atan2(static_cast<double>(u), static_cast<double>(v)); });
    case Op::fmod:
        return use([](C u, C v) { return rest_of(u, v); });
    case Op::mod:
        return use([](C u, C v) {
            C const rest = rest_of(u, v);
            return rest != C(0) && (rest < C(0)) != (v < C(0)) ? rest + v : rest;
        });
    case Op::hypot:
        if constexpr (sizeof(C) == 4)
            return use([](C u, C v) {
                double const p = static_cast<double>(u), q = static_cast<double>(v);
                double const length = std::sqrt(p * p + q * q), infinite = std::numeric_limits<double>::infinity();
                return std::fabs(p) == infinite || std::fabs(q) == infinite ? infinite : length;
            });
        else
            return use([](C u, C v) { return std::hypot(static_cast<double>(u), static_cast<double>(v)); });
    case Op::lt:
        return use([](C u, C v) { return u < v ? C(1) : C(0); });
    case Op::le:
        return use([](C u, C v) { return u <= v ? C(1) : C(0); });
    case Op::eq:
        return use([](C u, C v) { return u == v ? C(1) : C(0); });
    case Op::ne:
        return use([](C u, C v) { return u != v ? C(1) : C(0); });
    case Op::and_:
        return use([](C u, C v) { return u != C(0) && v != C(0) ? C(1) : C(0); });
    default: // or
        return use([](C u, C v) { return u != C(0) || v != C(0) ? C(1) : C(0); });
    }
}

/// The same for three.
template <class C, class Use> VKT_HD void with_three(Op op, Use&& use) {
    if (op == Op::select) return use([](C u, C v, C w) { return u != C(0) ? v : w; });
    use([](C u, C low, C high) {
        C const above = u < low ? low : u; // NaN passes
        return above > high ? high : above;
    });
}

} // namespace vkt::VKT_BACKEND
