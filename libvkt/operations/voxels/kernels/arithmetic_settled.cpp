// The same pieces of rows as map's, and exact arithmetic where their results lie half-way between voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/arithmetic_settled.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/arithmetic_values.h"

#include <algorithm>
#include <utility>

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct SettledTask {
    ArithmeticOp op;
    ExactOperand const &a, &b;
};

template <class C> C combine_one(ArithmeticOp op, C a, C b) {
    C result{};
    with_op(op, [&]<ArithmeticOp o>() { result = Combined<o, C>::of(a, b); });
    return result;
}

/// False only if the real number that was rounded to v rounds to the same T as v does: unless v lies half-way between
/// two neighbours in T, both lie on the same side of whatever is half-way.
template <class T, class C> bool may_round_twice(C v) {
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

/// True if r is a op b without rounding, which a real half-way value often is. False says nothing.
template <class C> bool is_exact(ArithmeticOp op, C a, C b, C r) {
    if (op == ArithmeticOp::sub) b = -b;
    if (op == ArithmeticOp::absdiff && a < b) std::swap(a, b);
    if (op == ArithmeticOp::absdiff) b = -b;
    if (op == ArithmeticOp::add || op == ArithmeticOp::sub ||
        op == ArithmeticOp::absdiff) { // the error of a sum (Knuth, TAOCP 2, 4.2.2)
        C const back = r - a;
        return (a - (r - back)) + (b - back) == C(0);
    }
    if (op == ArithmeticOp::div) std::swap(a, r); // a = r * b
    if constexpr (sizeof(C) == 4) {
        return static_cast<double>(a) * static_cast<double>(b) == static_cast<double>(r);
    } else {
        bool const has_room = (r < 0 ? -r : r) > 0x1p-900; // for the last bit of the product
        return has_room && __builtin_fma(a, b, -r) == 0;
    }
}

ExactNumber exact_operand(ExactOperand const& operand, std::int64_t x, std::int64_t y, std::int64_t z) {
    ExactNumber result = operand.exact_number;
    if (operand.view == nullptr) return result;
    with_type(operand.view->type, [&]<class T>(T) {
        T const voxel = *reinterpret_cast<T const*>(operand.view->at(x, y, z));
        if constexpr (std::is_integral_v<T>)
            result = ExactNumber::of(
                static_cast<std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>>(voxel));
        else
            result = ExactNumber::of(static_cast<double>(voxel));
    });
    return result;
}

template <class T> T store_exactly(ExactResult const& value, DataType type, Losses& losses) {
    if constexpr (std::is_integral_v<T>) {
        constexpr Int128 low = std::numeric_limits<T>::lowest(), high = std::numeric_limits<T>::max();
        Int128 const nearest = nearest_integer(value);
        losses.clipped += nearest < low || nearest > high;
        return static_cast<T>(std::clamp(nearest, low, high));
    } else {
        double const nearest = nearest_float(value, type);
        losses.clipped += is_clipped<T>(nearest);
        return round_to<T>(nearest);
    }
}

/// The result of a and b, of which u and v are the nearest doubles, rounded once.
template <class T>
T settle(ArithmeticOp op, DataType type, double u, double v, ExactNumber a, ExactNumber b, Losses& losses) {
    bool const finite = u - u == 0 && v - v == 0, product = op == ArithmeticOp::mul;
    bool const division = op == ArithmeticOp::div;
    bool const picks = op == ArithmeticOp::min || op == ArithmeticOp::max;
    if (picks) {
        bool first = combine_one(op, u, v) == u;
        if (finite) first = op == ArithmeticOp::min ? compare(a, b) <= 0 : compare(a, b) >= 0;
        double const chosen = first ? u : v;
        if (finite || (chosen - chosen == 0 && u == u && v == v))
            return store_exactly<T>(exact_sum(first ? a : b, {}), type, losses);
    }
    if (is_comparison(op) && finite) return static_cast<T>(combine_one(op, static_cast<double>(compare(a, b)), 0.0));
    if (!finite || ((product || division) && (u == 0 || v == 0))) { // IEEE 754 knows no rounding here
        double const result = combine_one(op, u, v);
        losses.clipped += is_clipped<T>(result);
        losses.nan += is_lost_nan<T>(result);
        return round_to<T>(result);
    }
    if (op == ArithmeticOp::sub || op == ArithmeticOp::absdiff) b.negative = !b.negative;
    ExactResult result = product ? exact_product(a, b) : division ? exact_quotient(a, b) : exact_sum(a, b);
    if (op == ArithmeticOp::absdiff) result.negative = false;
    return store_exactly<T>(result, type, losses);
}

/// Replaces the voxels at `to` whose results may have been rounded twice, and what `losses` knows of them. u and v are
/// the operands as loaded.
template <class T, class C>
void settle_row(SettledTask const& task, C const* u, C const* v, C const* result, std::int64_t n, AnyView out,
                Index3 at, Losses& losses) {
    C const from_a = static_cast<C>(task.a.inexact_from), from_b = static_cast<C>(task.b.inexact_from);
    bool const picks = task.op == ArithmeticOp::min || task.op == ArithmeticOp::max;
    auto const inexact = [=](C a, C b) {
        return ((a < C(0) ? -a : a) >= from_a ? 1 : 0) | ((b < C(0) ? -b : b) >= from_b ? 1 : 0);
    };
    auto const doubtful = [=](C a, C b, C r) {
        int const twice = may_round_twice<T>(r) && !picks && !is_comparison(task.op);
        return twice | inexact(a, b);
    };
    std::int32_t count = 0;
#pragma omp simd reduction(+ : count)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) count += doubtful(u[i], v[i], result[i]);
    if (count == 0) return;
    T* const to = reinterpret_cast<T*>(out.at(at.x, at.y, at.z));
    for (std::int64_t i = 0; i < n; ++i) {
        if (doubtful(u[i], v[i], result[i]) == 0) continue;
        if (inexact(u[i], v[i]) == 0 && is_exact(task.op, u[i], v[i], result[i])) continue;
        losses.clipped -= is_clipped<T>(result[i]);
        losses.nan -= is_lost_nan<T>(result[i]);
        to[i] =
            settle<T>(task.op, out.type, static_cast<double>(u[i]), static_cast<double>(v[i]),
                      exact_operand(task.a, at.x + i, at.y, at.z), exact_operand(task.b, at.x + i, at.y, at.z), losses);
    }
}

template <class C> void settled(SettledTask const& task, AnyView out, Losses& losses, Execution const& execution) {
    auto const row = [](ExactOperand const& operand, Index3 at, std::int64_t n, C* buffer) -> C const* {
        return operand.view == nullptr ? buffer : driver::row_of<C>(*operand.view, at.x, at.y, at.z, n, buffer);
    };
    for_each_segment(execution, out.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) C a[row_piece], b[row_piece], result[row_piece];
        std::fill_n(a, std::min(row_piece, n), static_cast<C>(task.a.number));
        std::fill_n(b, std::min(row_piece, n), static_cast<C>(task.b.number));
        Losses mine;
        for (std::int64_t begin = x; begin < x + n; begin += row_piece) {
            std::int64_t const m = std::min(row_piece, x + n - begin);
            C const *const u = row(task.a, {begin, y, z}, m, a), *const v = row(task.b, {begin, y, z}, m, b);
            with_op(task.op, [&]<ArithmeticOp op>() {
#pragma omp simd
                for (std::int64_t i = 0; i < m; ++i) result[i] = Combined<op, C>::of(u[i], v[i]);
            });
            Losses stored = store_row(out.type, static_cast<C const*>(result), out.at(begin, y, z), m);
            with_type(out.type, [&]<class T>(T) {
                settle_row<T>(task, u, v, static_cast<C const*>(result), m, out, {begin, y, z}, stored);
            });
            mine += stored;
        }
        driver::add(losses, mine);
    });
}

} // namespace

void arithmetic_settled(ArithmeticOp op, bool in_float, ExactOperand const& a, ExactOperand const& b, AnyView out,
                        Losses& losses, Execution const& execution) {
    SettledTask const task{op, a, b};
    in_float ? settled<float>(task, out, losses, execution) : settled<double>(task, out, losses, execution);
}

} // namespace VKT_BACKEND

} // namespace vkt
