// Arithmetic as one functor: on CPUs a row at a time, so that the operation is chosen once a row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/arithmetic.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/operations/voxels/kernels/arithmetic_values.h"

#include <algorithm>

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class C> struct Line {
    C slope = C(1), intercept = C(0);
    bool identity = true;

    static Line from(ValueMap const& map) {
        return {static_cast<C>(map.slope), static_cast<C>(map.intercept), map == ValueMap{}};
    }
    VKT_HD C of(C v) const {
        if constexpr (std::is_floating_point_v<C>) {
            if (identity) return v; // also -0
            C const value = slope * v + intercept;
            // The product may be beyond C where the sum is not.
            return value - value == 0 ? value : C(2) * (C(0.5) * slope * v + C(0.5) * intercept);
        }
        return v;
    }
};

/// Operands: volumes in their order, numbers where there is none.
template <class C> struct Operands {
    [[maybe_unused]] static constexpr bool is_long = true;
    ArithmeticOp op;
    int first, second, third; ///< which volume, -1 for a number
    C a, b, c;                ///< the numbers
    Line<C> map_a, map_b, map_c, result;
    bool counts_zeros, counts_undefined;
    C lowest, highest;

    template <ArithmeticOp o> VKT_HD C combined(C u, C v) const {
        if constexpr (o == ArithmeticOp::div)
            if (counts_zeros && v == C(0)) return u > C(0) ? highest : u < C(0) ? lowest : C(0);
        return Combined<o, C>::of(u, v);
    }
    VKT_HD C stored(C v) const {
        if constexpr (std::is_floating_point_v<C>) return result.identity ? v : (v - result.intercept) / result.slope;
        return v;
    }
    VKT_HD C chosen(C u, C v, C w) const {
        if (op == ArithmeticOp::where) return u != C(0) ? v : w;
        C const above = u < v ? v : u; // NaN passes
        return above > w ? w : above;
    }
    VKT_HD C evaluate(C u, C v, C w) const {
        if (op == ArithmeticOp::clamp || op == ArithmeticOp::where)
            return stored(chosen(map_a.of(u), map_b.of(v), map_c.of(w)));
        C const p = map_a.of(u), q = map_b.of(v);
        if (counts_zeros && q == C(0)) return p > C(0) ? highest : p < C(0) ? lowest : C(0);
        C const value = combined_of(op, p, q);
        return stored(value);
    }
    VKT_HD C operator()(C v0) const { return evaluate(first == 0 ? v0 : a, second == 0 ? v0 : b, third == 0 ? v0 : c); }
    VKT_HD C operator()(C v0, C v1) const {
        return evaluate(first == 0 ? v0 : a,
                        second < 0    ? b
                        : second == 0 ? v0
                                      : v1,
                        third < 0    ? c
                        : third == 0 ? v0
                                     : v1);
    }
    VKT_HD C operator()(C v0, C v1, C v2) const { return evaluate(first == 0 ? v0 : a, v1, v2); }

    /// Whether pack() may be called: operations whose code is short, of volumes in their usual places.
    VKT_HD bool takes_packs() const {
        if (!is_short(op) || !numbers_have_no_map()) return false;
        bool const picks = op == ArithmeticOp::clamp || op == ArithmeticOp::where; // has a third operand
        if (picks && !picks_what_is_stored()) return false;
        if (first < 1 && second < 1) return !picks || (first == 0 && second < 0 && third != 0 && third <= 1);
        return first == 0 && second == 1 && (!picks || third < 0 || third == 2);
    }
    /// Many voxels at once: what is to be done is chosen once for all of them.
    template <int inputs, int N>
    VKT_HD void pack(C const (&in)[inputs][N], C (&out)[N]) const requires std::is_floating_point_v<C> {
        C values[inputs][N];
        for (int i = 0; i < inputs; ++i)
            for (int n = 0; n < N; ++n) values[i][n] = in[i][n];
        // One of two registers, or a number: no array is looked up by what is known only when it runs.
        auto const u = [&](int n) { return inputs > 1 || first == 0 ? values[0][n] : a; };
        auto const v = [&](int n) { return second == (inputs > 1 ? 1 : 0) ? values[inputs > 1 ? 1 : 0][n] : b; };
        if (op == ArithmeticOp::clamp || op == ArithmeticOp::where) {
            auto const w = [&](int n) { return inputs > 1 && third >= 0 ? values[inputs - 1][n] : c; };
            for (int n = 0; n < N; ++n) out[n] = chosen(u(n), v(n), w(n));
            return;
        }
        Line<C> const map = first == 0 ? map_a : map_b;
        if (!map.identity)
            for (int n = 0; n < N; ++n) values[0][n] = map.of(values[0][n]);
        if (inputs > 1 && !map_b.identity)
            for (int n = 0; n < N; ++n) values[inputs > 1 ? 1 : 0][n] = map_b.of(values[inputs > 1 ? 1 : 0][n]);
        with_short_op(op, [&]<ArithmeticOp o>() {
            for (int n = 0; n < N; ++n) out[n] = combined<o>(u(n), v(n));
        });
        if (!result.identity)
            for (int n = 0; n < N; ++n) out[n] = stored(out[n]);
    }

    VKT_HD bool undefined(C v0) const { return has_no_value(first == 0 ? v0 : a, second == 0 ? v0 : b); }
    VKT_HD bool undefined(C v0, C v1) const {
        return has_no_value(first == 0 ? v0 : a, second < 0 ? b : second == 0 ? v0 : v1);
    }
    VKT_HD bool undefined(C, C, C) const { return false; }
    VKT_HD bool may_be_undefined() const { return counts_undefined; }

    /// The same of a row: what it depends on is chosen once.
    template <class... In> std::int64_t undefined_in_row(std::int64_t n, In const*... in) const {
        C const* const volumes[] = {in...};
        bool const root = op == ArithmeticOp::sqrt, logarithm = op == ArithmeticOp::log;
        if ((root || logarithm) && first >= 0) {
            return root ? count_row(n, volumes[first], map_a, [](C p) { return p < C(0); })
                        : count_row(n, volumes[first], map_a, [](C p) { return p <= C(0); });
        }
        if (op == ArithmeticOp::div && second >= 0)
            return count_row(n, volumes[second], map_b, [](C q) { return q == C(0); });
        std::int64_t count = 0;
        for (std::int64_t i = 0; i < n; ++i) count += undefined(in[i]...) ? 1 : 0;
        return count;
    }

    // A row at a time, of numbers too; one loop after the other, so that there are not as many as combinations of them.
    template <class... In> void row(std::int64_t n, C* out, In const*... in) const {
        C const* const volumes[] = {in...};
        alignas(64) C buffers[3][row_piece];
        auto const operand = [&](int k, int volume, C number) -> C const* {
            if (volume >= 0) return volumes[volume];
            std::fill_n(buffers[k], n, number);
            return buffers[k];
        };
        C const *u = operand(0, first, a), *v = operand(1, second, b);
        if (!map_a.identity) u = mapped_row(n, map_a, u, buffers[0]);
        if (!map_b.identity) v = mapped_row(n, map_b, v, buffers[1]);
        if (op == ArithmeticOp::clamp || op == ArithmeticOp::where) {
            C const* w = operand(2, third, c);
            if (!map_c.identity) w = mapped_row(n, map_c, w, buffers[2]);
            choose_row(n, out, u, v, w);
        } else {
            combine_row(n, out, u, v);
        }
        if (!result.identity) store_row_of(n, out);
    }

private:
    VKT_HD bool picks_what_is_stored() const {
        return map_a.identity && map_b.identity && map_c.identity && result.identity;
    }
    /// Numbers are what they are, and a volume that is both operands has one map.
    VKT_HD bool numbers_have_no_map() const {
        return (first >= 0 || map_a.identity) && (second >= 0 || map_b.identity) &&
               (first != second || (map_a.identity && map_b.identity));
    }
    VKT_HD bool has_no_value(C u, C v) const {
        if (!counts_undefined) return false;
        C const p = map_a.of(u), q = map_b.of(v);
        if (op == ArithmeticOp::sqrt) return p < C(0);
        if (op == ArithmeticOp::log) return p <= C(0);
        if constexpr (std::is_floating_point_v<C>)
            if (op == ArithmeticOp::pow)
                return (p < C(0) && q - q == C(0) && q != std::floor(q)) || (p == C(0) && q < C(0));
        return counts_zeros && q == C(0);
    }
    template <class F> static std::int64_t count_row(std::int64_t n, C const* from, Line<C> const map, F const f) {
        std::int32_t count = 0;
        if (map.identity) {
#pragma omp simd reduction(+ : count)
            for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) count += f(from[i]) ? 1 : 0;
        } else {
#pragma omp simd reduction(+ : count)
            for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) count += f(map.of(from[i])) ? 1 : 0;
        }
        return count;
    }
    static C const* mapped_row(std::int64_t n, Line<C> const map, C const* from, C* to) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = map.of(from[i]);
        return to;
    }
    void store_row_of(std::int64_t n, C* out) const {
        Operands const f = *this; // see driver::apply
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) out[i] = f.stored(out[i]);
    }
    void choose_row(std::int64_t n, C* out, C const* u, C const* v, C const* w) const {
        Operands const f = *this;
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) out[i] = f.chosen(u[i], v[i], w[i]);
    }
    void combine_row(std::int64_t n, C* out, C const* u, C const* v) const {
        Operands const f = *this;
        if (counts_zeros) { // of divisions
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) out[i] = f.template combined<ArithmeticOp::div>(u[i], v[i]);
            return;
        }
        with_op(op, [&]<ArithmeticOp o>() {
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) out[i] = Combined<o, C>::of(u[i], v[i]);
        });
    }
};

template <class C> C number_of(ArithmeticTask const& task, std::size_t i) {
    if constexpr (std::is_same_v<C, Int128>)
        return task.whole[i];
    else
        return static_cast<C>(task.number[i]);
}

template <class C>
void run(ArithmeticTask const& task, std::span<ConstView const> in, AnyView out, Losses& losses,
         Execution const& execution) {
    Operands<C> const f{task.op,
                        task.volume[0],
                        task.volume[1],
                        task.volume[2],
                        number_of<C>(task, 0),
                        number_of<C>(task, 1),
                        number_of<C>(task, 2),
                        Line<C>::from(task.map[0]),
                        Line<C>::from(task.map[1]),
                        Line<C>::from(task.map[2]),
                        Line<C>::from(task.result),
                        task.counts_zeros,
                        task.counts_zeros || has_poles(task.op),
                        static_cast<C>(task.lowest),
                        static_cast<C>(task.highest)};
    if (in.size() == 1) return map<C>(execution, out, losses, f, in[0]);
    if (in.size() == 2) return map<C>(execution, out, losses, f, in[0], in[1]);
    map<C>(execution, out, losses, f, in[0], in[1], in[2]);
}

} // namespace

void arithmetic(ArithmeticTask const& task, std::span<ConstView const> in, AnyView out, Losses& losses,
                Execution const& execution) {
    if (task.type == ArithmeticType::in_float) return run<float>(task, in, out, losses, execution);
    if (task.type == ArithmeticType::in_double) return run<double>(task, in, out, losses, execution);
    run<Int128>(task, in, out, losses, execution);
}

} // namespace VKT_BACKEND

} // namespace vkt
