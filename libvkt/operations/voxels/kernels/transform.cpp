// Expressions: each operation is one loop over a piece of a row, whose values stay in the first cache.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/transform.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/elementwise.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

// Functors arrive by value, see driver::apply. `to` may be one of the operands.
template <class C, class F> void each(std::int64_t n, C* to, C const* a, F const f) {
#pragma omp simd
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) to[i] = static_cast<C>(f(a[i]));
}
template <class C, class F> void each(std::int64_t n, C* to, C const* a, C const* b, F const f) {
#pragma omp simd
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) to[i] = static_cast<C>(f(a[i], b[i]));
}
template <class C, class F> void each(std::int64_t n, C* to, C const* a, C const* b, C const* c, F const f) {
#pragma omp simd
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) to[i] = static_cast<C>(f(a[i], b[i], c[i]));
}

/// What some value does not fulfil is asked for all of them first, since `to` may be what is looked at.
template <class C, class F> bool all(std::int64_t n, C const* a, F const f) {
    std::int32_t misses = 0;
#pragma omp simd reduction(+ : misses)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) misses += f(a[i]) ? 0 : 1;
    return misses == 0;
}

/// Angles below most_angle by the vectors' function; the C library's for the others, value by value.
template <class C, class Fast, class Slow>
void of_angles(std::int64_t n, C* to, C const* a, Fast const fast, Slow const slow) {
    auto const small = [](C v) { return std::fabs(v) < C(most_angle); };
    if (all(n, a, small)) return each(n, to, a, fast);
    for (std::int64_t i = 0; i < n; ++i)
        to[i] = static_cast<C>(small(a[i]) ? fast(a[i]) : slow(static_cast<double>(a[i])));
}

template <class C> void apply_one(Op op, std::int64_t n, C* to, C const* a) {
    if (op == Op::sin)
        return of_angles(
            n, to, a, [](C u) { return sine_of(static_cast<double>(u), 0); }, [](double u) { return std::sin(u); });
    if (op == Op::cos)
        return of_angles(
            n, to, a, [](C u) { return sine_of(static_cast<double>(u), 1); }, [](double u) { return std::cos(u); });
    if (op == Op::tan)
        return of_angles(
            n, to, a, [](C u) { return tangent_of(static_cast<double>(u)); }, [](double u) { return std::tan(u); });
    with_one<C>(op, [&](auto const f) { each(n, to, a, f); });
}
template <class C> void apply_two(Op op, std::int64_t n, C* to, C const* a, C const* b) {
    with_two<C>(op, [&](auto const f) { each(n, to, a, b, f); });
}
template <class C> void apply_three(Op op, std::int64_t n, C* to, C const* a, C const* b, C const* c) {
    with_three<C>(op, [&](auto const f) { each(n, to, a, b, c, f); });
}

/// One thread's slots.
template <class C> class Machine {
public:
    Machine(TransformTask const& task, std::span<ConstView const> in, AnyView out, std::byte* workspace)
        : task_(task), program_(*task.program), in_(in), out_(out), stream_(driver::is_large(out)) {
        slots_ = reinterpret_cast<C**>(workspace);
        rows_ = reinterpret_cast<C const**>(workspace + static_cast<std::size_t>(program_.slots) * sizeof(C*));
        auto const used = static_cast<std::size_t>(program_.slots) + program_.rows.size();
        auto* next = reinterpret_cast<C*>(workspace + (used * sizeof(void*) + 63) / 64 * 64);
        for (int i = 0; i < program_.buffers; ++i, next += program_piece) slots_[i] = next;
        buffers_ = next;
        for (ProgramNumber const& number : program_.numbers)
            for (std::int64_t i = 0; i < program_piece; ++i) slots_[number.slot][i] = static_cast<C>(number.value);
    }

    /// Computes n voxels of the output's row (y, z) from x on.
    void run(std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        if (x != x_ || n > along_) {
            for (Instruction const& one : program_.along_x) execute(one, x, y, z, n);
            x_ = x;
            along_ = n;
        }
        if (y != y_ || z != z_) {
            for (Instruction const& one : program_.per_row) {
                execute(one, x, y, z, 1);
                C* const to = slots_[one.to];
                if (one.spread)
                    for (std::int64_t i = 1; i < program_piece; ++i) to[i] = to[0];
            }
            y_ = y;
            z_ = z;
        }
        take_rows(x, y, z, n);
        driver::RowResult<C> result(out_, out_.at(x, y, z), stream_);
        slots_[program_.result] = result.data();
        for (Instruction const& one : program_.per_voxel) execute(one, x, y, z, n);
        count(result.data(), n);
        if (!(task_.result == ValueMap{})) {
            auto const slope = static_cast<C>(task_.result.slope), intercept = static_cast<C>(task_.result.intercept);
            each(n, result.data(), result.data(), [=](C v) { return (v - intercept) / slope; });
        }
        losses_.losses += result.store(n);
    }
    TransformLosses const& losses() const { return losses_; }

private:
    void take_rows(std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        for (std::size_t r = 0; r < program_.rows.size(); ++r) {
            ProgramRow const& row = program_.rows[r];
            ConstView const in = in_[static_cast<std::size_t>(row.volume)];
            ValueMap const map = task_.maps[static_cast<std::size_t>(row.volume)];
            std::int64_t const m = n + row.until - row.from;
            C* const buffer = buffers_ + static_cast<std::int64_t>(r) * row_piece;
            rows_[r] = driver::row_of<C>(in, x + row.from, y + row.y, z + row.z, m, buffer);
            if (map == ValueMap{}) continue;
            auto const slope = static_cast<C>(map.slope), intercept = static_cast<C>(map.intercept);
            each(m, buffer, rows_[r], [=](C v) {
                C const value = slope * v + intercept;
                // The product may be beyond C where the sum is not.
                bool const finite = value - value == 0; // NOLINT(misc-redundant-expression)
                return finite ? value : C(2) * (C(0.5) * slope * v + C(0.5) * intercept);
            });
            rows_[r] = buffer;
        }
        // What is read only; slots of results are others.
        for (ProgramVoxel const& voxel : program_.voxels)
            slots_[voxel.slot] = const_cast<C*>(rows_[voxel.row] + voxel.aside);
    }

    void execute(Instruction const& one, std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) const {
        C* const to = slots_[one.to];
        int const operands = operands_of(one.op);
        if (operands == 3) return apply_three(one.op, n, to, in(one, 0), in(one, 1), in(one, 2));
        if (operands == 2) return apply_two(one.op, n, to, in(one, 0), in(one, 1));
        ProgramPlace const& place = task_.place;
        Vec3 const at{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
        if (one.op == Op::x) {
            double const first = place.first.x, step = place.step.x, begin = at.x;
            return fill(n, to, [=](double i) { return first + step * (begin + i); });
        }
        if (one.op == Op::y || one.op == Op::z) {
            int const axis = one.op == Op::y ? 1 : 2;
            double const value = place.first[axis] + place.step[axis] * at[axis];
            return fill(n, to, [=](double) { return value; });
        }
        if (is_world(one.op)) {
            int const axis = static_cast<int>(one.op) - static_cast<int>(Op::wx);
            double const origin = place.origin[axis], along = place.column[0][axis], begin = at.x;
            double const beside = place.column[1][axis] * at.y, above = place.column[2][axis] * at.z;
            return fill(n, to, [=](double i) { return ((origin + along * (begin + i)) + beside) + above; });
        }
        apply_one(one.op, n, to, in(one, 0));
    }
    C const* in(Instruction const& one, std::size_t i) const { return slots_[one.in[i]]; }
    template <class F> static void fill(std::int64_t n, C* to, F const f) {
#pragma omp simd
        for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i)
            to[i] = static_cast<C>(f(static_cast<double>(i)));
    }

    bool is_wide(int volume) const {
        DataType const type = in_[static_cast<std::size_t>(volume)].type;
        return is_integer(type) && size_of(type) == 8;
    }

    void count(C const* result, std::int64_t n) {
        constexpr C most = std::numeric_limits<C>::max();
        auto const finite = [](C v) { return std::fabs(v) <= most; };
        if (task_.counts_undefined && !all(n, result, finite))
            for (std::int64_t i = 0; i < n; ++i) {
                if (finite(result[i])) continue;
                bool known = true;
                for (ProgramVoxel const& voxel : program_.voxels) known = known && finite(slots_[voxel.slot][i]);
                losses_.losses.undefined += known ? 1 : 0;
            }
        if constexpr (sizeof(C) == 8) {
            auto const held = [](C v) { return !(std::fabs(v) >= 0x1p53); };
            bool const wide = is_integer(out_.type) && size_of(out_.type) == 8;
            bool beyond = wide && !all(n, result, held);
            for (ProgramVoxel const& voxel : program_.voxels)
                beyond = beyond || (is_wide(program_.rows[voxel.row].volume) && !all(n, slots_[voxel.slot], held));
            if (!beyond) return;
            for (std::int64_t i = 0; i < n; ++i) {
                bool exact = !wide || held(result[i]);
                for (ProgramVoxel const& voxel : program_.voxels)
                    exact = exact && (!is_wide(program_.rows[voxel.row].volume) || held(slots_[voxel.slot][i]));
                losses_.inexact += exact ? 0 : 1;
            }
        }
    }

    TransformTask const& task_;
    Program const& program_;
    std::span<ConstView const> in_;
    AnyView out_;
    bool stream_;
    C** slots_;
    C const** rows_;
    C* buffers_; ///< of rows that are not stored as C
    std::int64_t x_ = std::numeric_limits<std::int64_t>::min(), along_ = 0, y_ = x_, z_ = x_;
    TransformLosses losses_;
};

/// True if all rows that follow one another may be treated as one.
bool as_one_row(TransformTask const& task, std::span<ConstView const> in, AnyView out) {
    if (task.program->positions || !driver::dense(out.box, out) || out.box.empty()) return false;
    for (ProgramRow const& row : task.program->rows) {
        ConstView const& view = in[static_cast<std::size_t>(row.volume)];
        if (row.y != 0 || row.z != 0 || row.from != 0 || row.until != 0 || !driver::dense(out.box, view)) return false;
    }
    return true;
}

template <class C>
void run(TransformTask const& task, std::span<ConstView const> in, AnyView out, TransformLosses& losses,
         Execution const& execution) {
    bool const one_row = as_one_row(task, in, out);
    Box const box = one_row ? driver::as_one_row(out.box) : out.box;
    Index3 const dims = box.dims();
    std::int64_t const pieces = (dims.x + program_piece - 1) / program_piece;
    for_each_item(execution, threads_for(execution, box.voxels()), pieces * dims.y * dims.z,
                  [&](std::int64_t begin, std::int64_t end) {
                      auto const thread = static_cast<std::size_t>(omp_get_thread_num());
                      Machine<C> machine(task, in, out, task.workspace + thread * task.workspace_bytes);
                      for (std::int64_t item = begin; item < end; ++item) {
                          std::int64_t const x = item % pieces * program_piece, row = item / pieces;
                          machine.run(box.lower.x + x, box.lower.y + row % dims.y, box.lower.z + row / dims.y,
                                      std::min(program_piece, dims.x - x));
                      }
                      stream_fence();
                      driver::add(losses.losses, machine.losses().losses);
                      if (machine.losses().inexact != 0) {
#pragma omp atomic
                          losses.inexact += machine.losses().inexact;
                      }
                  });
}

} // namespace

void transform_voxels(TransformTask const& task, std::span<ConstView const> in, AnyView out, TransformLosses& losses,
                      Execution const& execution) {
    if (out.box.empty()) return;
    if (task.in_float) return run<float>(task, in, out, losses, execution);
    run<double>(task, in, out, losses, execution);
}

} // namespace VKT_BACKEND

} // namespace vkt
