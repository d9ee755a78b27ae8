// Arithmetic: pieces of rows in float or double; voxels that this would round twice once more exactly. 64-bit integers
// among themselves in 128 bits.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/arithmetic.h"

#include "libvkt/kernel/rows.h"

#include <bit>
#include <cmath>
#include <limits>
#include <utility>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// True if the stored voxels are what is computed with, as they lie.
template <class C> bool is_direct(DataType type, ValueMap const& map) {
    return type == (std::is_same_v<C, float> ? DataType::float32 : DataType::float64) && map == ValueMap{};
}

/// A piece of a row to compute with: the voxels themselves where they can be taken as they lie, else loaded into
/// `buffer`, which holds the number already if the operand is one.
template <class C>
C const* operand_row(ArithmeticOperand const& operand, std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n,
                     C* buffer) {
    if (operand.view == nullptr) return buffer;
    std::byte const* const from = operand.view->at(x, y, z);
    if (is_direct<C>(operand.view->type, operand.map)) return reinterpret_cast<C const*>(from);
    load_row(operand.view->type, from, buffer, n);
    if (operand.map == ValueMap{}) return buffer;
    C const slope = static_cast<C>(operand.map.slope), intercept = static_cast<C>(operand.map.intercept);
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        C const value = slope * buffer[i] + intercept;
        // The product may be beyond C where the sum is not.
        buffer[i] = value - value == 0 ? value : C(2) * (C(0.5) * slope * buffer[i] + C(0.5) * intercept);
    }
    return buffer;
}

template <class C, class F> void combine_with(C const* a, C const* b, C* out, std::int64_t n, F const f) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) out[i] = f(a[i], b[i]);
}

template <class C> void combine(ArithmeticOp op, C const* a, C const* b, C* out, std::int64_t n) {
    switch (op) {
    case ArithmeticOp::add:
        return combine_with(a, b, out, n, [](C u, C v) { return u + v; });
    case ArithmeticOp::sub:
        return combine_with(a, b, out, n, [](C u, C v) { return u - v; });
    case ArithmeticOp::mul:
        return combine_with(a, b, out, n, [](C u, C v) { return u * v; });
    case ArithmeticOp::div:
        return combine_with(a, b, out, n, [](C u, C v) { return u / v; });
    case ArithmeticOp::min:
        return combine_with(a, b, out, n, [](C u, C v) { return u < v || u != u ? u : v; });
    case ArithmeticOp::max:
        return combine_with(a, b, out, n, [](C u, C v) { return u > v || u != u ? u : v; });
    }
}

/// Integer division by zero shows as infinity (clipped) and NaN here; it is counted as what it is instead.
template <class C> void count_zero_divisors(C const* a, C const* b, std::int64_t n, Losses& counts) {
    for (std::int64_t i = 0; i < n; ++i) {
        if (b[i] != C(0)) continue;
        ++counts.undefined;
        (a[i] == C(0) ? counts.nan : counts.clipped) -= 1;
    }
}

template <class C> C combine_one(ArithmeticOp op, C a, C b) {
    C result;
    combine(op, &a, &b, &result, 1);
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
    if (op == ArithmeticOp::add || op == ArithmeticOp::sub) { // the error of a sum (Knuth, TAOCP 2, 4.2.2)
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

ExactNumber exact_operand(ArithmeticOperand const& operand, std::int64_t x, std::int64_t y, std::int64_t z) {
    ExactNumber result = operand.exact_number;
    if (operand.view == nullptr) return result;
    for_each_type(operand.view->type, [&]<class T>(T) {
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
T settle(ArithmeticTask const& task, DataType type, double u, double v, ExactNumber a, ExactNumber b, Losses& losses) {
    bool const finite = u - u == 0 && v - v == 0, product = task.op == ArithmeticOp::mul;
    bool const division = task.op == ArithmeticOp::div;
    bool const picks = task.op == ArithmeticOp::min || task.op == ArithmeticOp::max;
    if (picks) {
        bool first = combine_one(task.op, u, v) == u;
        if (finite) first = task.op == ArithmeticOp::min ? compare(a, b) <= 0 : compare(a, b) >= 0;
        double const chosen = first ? u : v;
        if (finite || (chosen - chosen == 0 && u == u && v == v))
            return store_exactly<T>(exact_sum(first ? a : b, {}), type, losses);
    }
    if (!finite || ((product || division) && (u == 0 || v == 0))) { // IEEE 754 knows no rounding here
        double const result = combine_one(task.op, u, v);
        losses.clipped += is_clipped<T>(result);
        losses.nan += is_lost_nan<T>(result);
        return round_to<T>(result);
    }
    if (task.op == ArithmeticOp::sub) b.negative = !b.negative;
    ExactResult const result = product ? exact_product(a, b) : division ? exact_quotient(a, b) : exact_sum(a, b);
    return store_exactly<T>(result, type, losses);
}

/// Replaces the voxels at `to` whose results may have been rounded twice, and what `losses` knows of them. u and v are
/// the operands as loaded.
template <class T, class C>
void settle_row(ArithmeticTask const& task, C const* u, C const* v, C const* result, std::int64_t n, AnyView out,
                Index3 at, Losses& losses) {
    C const from_a = static_cast<C>(task.a.inexact_from), from_b = static_cast<C>(task.b.inexact_from);
    bool const picks = task.op == ArithmeticOp::min || task.op == ArithmeticOp::max;
    auto const inexact = [=](C a, C b) {
        return ((a < C(0) ? -a : a) >= from_a ? 1 : 0) | ((b < C(0) ? -b : b) >= from_b ? 1 : 0);
    };
    auto const doubtful = [=](C a, C b, C r) {
        int const twice = may_round_twice<T>(r) && !picks;
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
            settle<T>(task, out.type, static_cast<double>(u[i]), static_cast<double>(v[i]),
                      exact_operand(task.a, at.x + i, at.y, at.z), exact_operand(task.b, at.x + i, at.y, at.z), losses);
    }
}

template <class C> void in_floats(ArithmeticTask const& task, AnyView out, Losses& counts, Execution const& execution) {
    C const slope = static_cast<C>(task.result.slope), intercept = static_cast<C>(task.result.intercept);
    bool const same_values = task.result == ValueMap{};
    bool const direct = is_direct<C>(out.type, task.result) && !task.settles;
    auto const dense = [&](ArithmeticOperand const& o) { return o.view == nullptr || driver::dense(out.box, *o.view); };
    bool const one_row = driver::dense(out.box, out) && dense(task.a) && dense(task.b);
    for_each_segment(execution, one_row ? driver::as_one_row(out.box) : out.box,
                     [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
                         alignas(64) C a[row_piece], b[row_piece];
                         if (task.a.view == nullptr)
                             std::fill_n(a, std::min(row_piece, n), static_cast<C>(task.a.number));
                         if (task.b.view == nullptr)
                             std::fill_n(b, std::min(row_piece, n), static_cast<C>(task.b.number));
                         for (std::int64_t begin = 0; begin < n; begin += row_piece) {
                             std::int64_t const m = std::min(row_piece, n - begin);
                             C const* const u = operand_row(task.a, x + begin, y, z, m, a);
                             C const* const v = operand_row(task.b, x + begin, y, z, m, b);
                             std::byte* const to = out.at(x + begin, y, z);
                             if (direct) { // nothing to clip and nothing to count
                                 combine(task.op, u, v, reinterpret_cast<C*>(to), m);
                                 continue;
                             }
                             Losses mine;
                             if (task.count_zeros) count_zero_divisors(u, v, m, mine);
                             alignas(64) C result[row_piece];
                             combine(task.op, u, v, result, m);
                             if (!same_values) {
#pragma omp simd
                                 for (std::int64_t i = 0; i < m; ++i) result[i] = (result[i] - intercept) / slope;
                             }
                             Losses losses = store_row(out.type, static_cast<C const*>(result), to, m);
                             if (task.settles)
                                 for_each_type(out.type, [&]<class T>(T) {
                                     settle_row<T>(task, u, v, result, m, out, {x + begin, y, z}, losses);
                                 });
                             mine.clipped += losses.clipped;
                             mine.nan += losses.nan;
                             driver::add(counts, mine);
                         }
                     });
}

template <class T> void load_integers(std::byte const* from, Int128* to, std::int64_t n) {
    auto const* const in = reinterpret_cast<T const*>(from);
    for (std::int64_t i = 0; i < n; ++i) to[i] = static_cast<Int128>(in[i]);
}

void load_operand(ArithmeticOperand const& operand, std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n,
                  Int128* to) {
    if (operand.view == nullptr) {
        std::fill_n(to, n, operand.whole);
        return;
    }
    for_each_type(operand.view->type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T>) load_integers<T>(operand.view->at(x, y, z), to, n);
    });
}

constexpr Int128 huge = (Int128{1} << 126) - 1 + (Int128{1} << 126); ///< the largest Int128: saturates every type

Int128 divide(Int128 a, Int128 b) { // halves to even
    Int128 const q = a / b, rest = a - q * b;
    Int128 const twice = (rest < 0 ? -rest : rest) * 2, size = b < 0 ? -b : b;
    if (twice < size || (twice == size && (q & 1) == 0)) return q;
    return (a < 0) == (b < 0) ? q + 1 : q - 1;
}

Int128 combine(ArithmeticOp op, Int128 a, Int128 b, Losses& counts) {
    switch (op) {
    case ArithmeticOp::add:
        return a + b;
    case ArithmeticOp::sub:
        return a - b;
    case ArithmeticOp::mul: {
        Int128 product = 0;
        return __builtin_mul_overflow(a, b, &product) ? ((a < 0) == (b < 0) ? huge : -huge) : product;
    }
    case ArithmeticOp::div:
        if (b != 0) return divide(a, b);
        ++counts.undefined;
        if (a != 0) --counts.clipped;
        return a > 0 ? huge : a < 0 ? -huge : 0;
    case ArithmeticOp::min:
        return std::min(a, b);
    case ArithmeticOp::max:
        return std::max(a, b);
    }
    return 0;
}

template <class T> std::int64_t store_integers(Int128 const* from, std::byte* to, std::int64_t n) {
    auto* const out = reinterpret_cast<T*>(to);
    std::int64_t clipped = 0;
    if constexpr (std::is_integral_v<T>) {
        constexpr Int128 low = std::numeric_limits<T>::lowest(), high = std::numeric_limits<T>::max();
        for (std::int64_t i = 0; i < n; ++i) {
            clipped += from[i] < low || from[i] > high;
            out[i] = static_cast<T>(std::clamp(from[i], low, high));
        }
    } else {
        for (std::int64_t i = 0; i < n; ++i) out[i] = round_to<T>(static_cast<double>(from[i]));
    }
    return clipped;
}

} // namespace

void arithmetic_float(ArithmeticTask const& task, AnyView out, Losses& counts, Execution const& execution) {
    in_floats<float>(task, out, counts, execution);
}

void arithmetic_double(ArithmeticTask const& task, AnyView out, Losses& counts, Execution const& execution) {
    in_floats<double>(task, out, counts, execution);
}

void arithmetic_integers(ArithmeticTask const& task, AnyView out, Losses& counts, Execution const& execution) {
    for_each_segment(execution, out.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) Int128 a[row_piece], b[row_piece];
        for (std::int64_t begin = 0; begin < n; begin += row_piece) {
            std::int64_t const m = std::min(row_piece, n - begin);
            load_operand(task.a, x + begin, y, z, m, a);
            load_operand(task.b, x + begin, y, z, m, b);
            Losses mine;
            for (std::int64_t i = 0; i < m; ++i) a[i] = combine(task.op, a[i], b[i], mine);
            for_each_type(out.type,
                          [&]<class T>(T) { mine.clipped += store_integers<T>(a, out.at(x + begin, y, z), m); });
            driver::add(counts, mine);
        }
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
