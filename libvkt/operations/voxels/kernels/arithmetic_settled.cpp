// The same pieces of rows as map's, and exact arithmetic where their results lie half-way between voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/arithmetic_settled.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/settled.h"

#include <algorithm>

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct SettledTask {
    ArithmeticOp op;
    ExactOperand const &a, &b;
};

ExactNumber exact_operand(ExactOperand const& operand, std::int64_t x, std::int64_t y, std::int64_t z) {
    ExactNumber result = operand.exact_number;
    if (operand.view == nullptr) return result;
    with_type(operand.view->type,
              [&]<class T>(T) { result = exact_voxel(*reinterpret_cast<T const*>(operand.view->at(x, y, z))); });
    return result;
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
