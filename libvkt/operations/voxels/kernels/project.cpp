// Projections: across rows pixels are the lanes of vectors and lines come one voxel after the other; along rows, which
// no slab cuts, voxels are. So results do not depend on where slabs end.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/project.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/voxels/kernels/projected_deviations.h"
#include "libvkt/operations/voxels/kernels/projected_lines.h"

#include <algorithm>
#include <cmath>

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct Unfinished {
    template <class T> void operator()(Lines<T> const&) const {}
};

/// The same as for_each_lines(), with pixels side by side: lines along rows are turned, a few at a time; then finish()
/// takes them as they were.
template <class T, class F, class Finish = Unfinished>
void for_each_upright(ProjectionState const& state, ConstView in, Execution const& execution, F const& f,
                      Finish const& finish = {}) {
    if (state.axis != 0) return for_each_lines<T>(state, in, pixels_together<T>(state), execution, f);
    constexpr std::int64_t together = 16, most = (16 << 10) / together / static_cast<int>(sizeof(T));
    for_each_lines<T>(state, in, together, execution, [&](Lines<T> const& rows) {
        alignas(64) T turned[together * most];
        for (std::int64_t k = 0; k < rows.n; k += most) {
            std::int64_t const n = std::min(most, rows.n - k);
            Lines<T> lines{rows.first + k, rows.pixel, 1, n, rows.at, rows.pixels};
            if (rows.pixels == together) {
                turn(rows.first + k, rows.pixel, together, n, static_cast<T*>(turned));
                lines = {turned, 1, together, n, rows.at, together};
            }
            f(lines);
        }
        finish(rows);
    });
}

/// Values of A in lanes, of as many voxels. A is T or double.
template <class A, class T> Lanes<A> load_as(T const* from) {
    if constexpr (std::is_same_v<A, T>)
        return load_lanes(from);
    else
        return load_doubles(from);
}

/// acc[i] = f(acc[i], voxel) for `rows` rows, `step` from one another. Returns how many voxels are NaN, if the functor
/// wants them counted. It arrives by value, as in the drivers.
template <int rows, class A, class T, class F>
std::int64_t fold_rows(T const* from, std::int64_t step, std::int64_t pixels, A* acc, F const f) {
    auto const fold = [=](std::int64_t i) {
        A value = acc[i];
        for (int r = 0; r < rows; ++r) value = f(value, static_cast<A>(from[r * step + i]));
        return value;
    };
    if constexpr (!std::is_floating_point_v<T>) {
#pragma omp simd
        for (std::int64_t i = 0; i < pixels; ++i) acc[i] = fold(i);
        return std::is_integral_v<T> || !F::counts_nan ? 0 : count_nan(Lines<T>{from, 1, step, rows, 0, pixels});
    } else { // compilers do not make vectors of comparisons that follow one another
        Lanes<A> odd{};
        std::int64_t i = 0;
        for (; i + lane_count<A> <= pixels; i += lane_count<A>) {
            Lanes<A> value = load_lanes(acc + i);
#pragma GCC unroll 8
            for (int r = 0; r < rows; ++r) {
                Lanes<A> const v = load_as<A>(from + r * step + i);
                if constexpr (F::counts_nan)
                    odd += v - v; // NOLINT(misc-redundant-expression): NaN of NaN and of infinities
                value = f(value, v);
            }
            store_lanes(acc + i, value);
        }
        bool finite = !F::counts_nan || i == pixels; // that is not looked at in those that are left
        for (; i < pixels; ++i) acc[i] = fold(i);
        for (std::int64_t lane = 0; lane < lane_count<A>; ++lane) finite = finite && odd[lane] == A(0);
        return finite ? 0 : count_nan(Lines<T>{from, 1, step, rows, 0, pixels});
    }
}

/// The same of all voxels of the lines.
template <class A, class T, class F> std::int64_t fold_lines(Lines<T> const& lines, A* acc, F const f) {
    std::int64_t nan = 0, k = 0;
    if (lines.pixel != 1) {
        for (; k < lines.n; ++k)
            for (std::int64_t i = 0; i < lines.pixels; ++i)
                acc[i] = f(acc[i], static_cast<A>(lines.first[k * lines.step + i * lines.pixel]));
        return F::counts_nan ? count_nan(lines) : 0;
    }
    // Rows that follow one another come one by one, which processors foresee; of those that are slices apart, several
    // at once, each a stream of its own.
    // Results that are wider than voxels take most of the time: they are loaded and stored less often then.
    if constexpr (sizeof(A) > sizeof(T) && sizeof(A) >= 4)
        for (; are_apart(lines) && k + 8 <= lines.n; k += 8)
            nan += fold_rows<8>(lines.first + k * lines.step, lines.step, lines.pixels, acc, f);
    for (; are_apart(lines) && k + 4 <= lines.n; k += 4)
        nan += fold_rows<4>(lines.first + k * lines.step, lines.step, lines.pixels, acc, f);
    for (; k < lines.n; ++k) nan += fold_rows<1>(lines.first + k * lines.step, lines.step, lines.pixels, acc, f);
    return nan;
}

// Of single values and of lanes.
struct Larger {
    static constexpr bool counts_nan = true;
    template <class V> V operator()(V a, V v) const { // NaN is no value, but what there is at first
        return ((v > a) | (a != a)) ? v : a;          // NOLINT(misc-redundant-expression)
    }
};
struct Smaller {
    static constexpr bool counts_nan = true;
    template <class V> V operator()(V a, V v) const {
        return ((v < a) | (a != a)) ? v : a; // NOLINT(misc-redundant-expression)
    }
};
struct Plus {
    static constexpr bool counts_nan = false;
    template <class V> V operator()(V a, V v) const { return static_cast<V>(a + v); }
};
/// a op v for numbers, of which the first of two that are equal stays: 0 and -0 are.
struct Above {
    template <class T> VKT_HD T operator()(T a, T v) const { return v > a ? v : a; }
    template <class V> static auto picks(V a, V v) { return v > a; }
};
struct Below {
    template <class T> VKT_HD T operator()(T a, T v) const { return v < a ? v : a; }
    template <class V> static auto picks(V a, V v) { return v < a; }
};

/// What a functor makes of values in lanes, the upper half with the lower one at a time: one after the other would take
/// as long as the row.
template <class A, std::size_t n, class F> A folded(A (&values)[n], F const f) {
#pragma GCC unroll 6
    for (std::size_t half = n / 2; half > 0; half /= 2)
#pragma omp simd
        for (std::size_t i = 0; i < half; ++i) values[i] = f(values[i], values[i + half]);
    return values[0];
}
template <class A, class F> A folded_lanes(Lanes<A> const& from, F const f) {
    A values[static_cast<std::size_t>(lane_count<A>)];
    store_lanes(values, from);
    return folded(values, f);
}

/// The extreme of a row, as if its voxels were looked at one after the other. `numbers` becomes false if some may be
/// NaN.
template <class A, class Best> A extreme_of_row(A const* row, std::int64_t n, Best const best, bool& numbers) {
    constexpr std::int64_t lanes = lane_count<A>, together = 4 * lanes;
    A result = row[0];
    std::int64_t k = 0;
    if (n >= together) {
        Lanes<A> most[4], odd[4] = {};
#pragma GCC unroll 4
        for (int r = 0; r < 4; ++r) most[r] = load_lanes(row + r * lanes);
        for (; k + together <= n; k += together)
#pragma GCC unroll 4
            for (int r = 0; r < 4; ++r) {
                __builtin_prefetch(row + k + 1024 + r * lanes);
                Lanes<A> const v = load_lanes(row + k + r * lanes);
                most[r] = best.picks(most[r], v) ? v : most[r];
                if constexpr (std::is_floating_point_v<A>) odd[r] += v - v; // NOLINT(misc-redundant-expression)
            }
        for (int r = 1; r < 4; ++r) {
            most[0] = best.picks(most[0], most[r]) ? most[r] : most[0];
            odd[0] += odd[r];
        }
        result = folded_lanes<A>(most[0], best);
        numbers = numbers && folded_lanes<A>(odd[0], Plus{}) == A(0);
    }
    for (; k < n; ++k) {
        result = best(result, row[k]);
        numbers = numbers && is_nan(row[k]) == 0;
    }
    if constexpr (std::is_floating_point_v<A>)
        if (result == A(0)) result = *std::find(row, row + n, A(0)); // lanes do not know which zero came first
    return result;
}

/// Adds the extremes of lines, of rows without NaN found first and then compared with what there is. Returns how many
/// voxels are NaN.
template <class A, class T, class Fold, class Best>
std::int64_t add_extremes_of(Lines<T> const& lines, A* image, Fold const fold, Best const best) {
    if constexpr (std::is_same_v<A, T>)
        if (lines.pixel != 1) {
            std::int64_t nan = 0;
            for (std::int64_t i = 0; i < lines.pixels; ++i) {
                T const* const row = lines.first + i * lines.pixel;
                bool numbers = true;
                A const found = extreme_of_row(row, lines.n, best, numbers);
                std::int64_t const missing = numbers ? 0 : count_nan(Lines<T>{row, 1, 0, 1, 0, lines.n});
                if (missing == 0)
                    image[i] = fold(image[i], found);
                else
                    for (std::int64_t k = 0; k < lines.n; ++k) image[i] = fold(image[i], row[k]);
                nan += missing;
            }
            return nan;
        }
    return fold_lines(lines, image, fold);
}

template <class T> void add_extremes(ProjectionState& state, ConstView in, Execution const& execution) {
    using A = std::conditional_t<std::is_same_v<T, Half>, float, T>;
    auto* const image = reinterpret_cast<A*>(state.extremes);
    std::int64_t const together = state.axis == 0 ? 4 : pixels_together<T>(state);
    for_each_lines<T>(state, in, together, execution, [&](Lines<T> const& lines) {
        bool const most = state.kind == Projection::max;
        add_nan(state, most ? add_extremes_of(lines, image + lines.at, Larger{}, Above{})
                            : add_extremes_of(lines, image + lines.at, Smaller{}, Below{}));
    });
}

/// The sum of a row, its numbers in lanes that take turns: the same ones whatever the registers hold. What is no number
/// adds nothing, but to `nan`.
template <class A, class T> A sum_of_row(T const* row, std::int64_t n, std::int64_t& nan) {
    A sums[row_lanes] = {};
    std::int32_t missing[row_lanes] = {};
    auto const value = [](T voxel) {
        A const v = static_cast<A>(voxel);
        if constexpr (std::is_integral_v<T>)
            return v;
        else
            return v == v ? v : A(0); // NOLINT(misc-redundant-expression): NaN
    };
    std::int64_t k = 0;
    for (; k + row_lanes <= n; k += row_lanes)
#pragma omp simd
        for (int j = 0; j < row_lanes; ++j) {
            sums[j] += value(row[k + j]);
            missing[j] += is_nan(row[k + j]);
        }
    for (int j = 0; k < n; ++k, ++j) {
        sums[j] += value(row[k]);
        missing[j] += is_nan(row[k]);
    }
    for (std::int32_t const count : missing) nan += count;
    return folded(sums, Plus{});
}

/// Sums of small integers that lie upright, at most most_pixels of them, in the smallest types that hold as many
/// voxels.
template <class T> void add_small(Lines<T> const& lines, std::int64_t* to) {
    alignas(64) std::int32_t sums[most_pixels];
    in_parts(lines, 32768, [&](Lines<T> const& long_part) {
        std::fill_n(sums, lines.pixels, 0);
        if constexpr (sizeof(T) == 1) {
            alignas(64) std::int16_t few[most_pixels];
            in_parts(long_part, 128, [&](Lines<T> const& part) {
                std::fill_n(few, lines.pixels, std::int16_t{0});
                fold_lines(part, static_cast<std::int16_t*>(few), Plus{});
                for (std::int64_t i = 0; i < lines.pixels; ++i) sums[i] += few[i];
            });
        } else {
            fold_lines(long_part, static_cast<std::int32_t*>(sums), Plus{});
        }
        for (std::int64_t i = 0; i < lines.pixels; ++i) to[i] += sums[i];
    });
}

/// Integers: small ones in 32 bits for as many voxels as fit.
template <class T> void add_whole(ProjectionState& state, ConstView in, Execution const& execution) {
    if (state.axis == 0 && state.wide == nullptr)
        return for_each_lines<T>(state, in, 1, execution, [&](Lines<T> const& line) {
            [[maybe_unused]] std::int64_t nan = 0;
            if constexpr (sizeof(T) <= 2)
                state.whole[line.at] += sums_along(line.first, line.n).sum;
            else
                state.whole[line.at] += sum_of_row<std::int64_t>(line.first, line.n, nan);
        });
    for_each_upright<T>(state, in, execution, [&](Lines<T> lines) {
        if (state.wide != nullptr)
            fold_lines(lines, state.wide + lines.at, Plus{});
        else if constexpr (sizeof(T) <= 2)
            add_small(lines, state.whole + lines.at);
        else
            fold_lines(lines, state.whole + lines.at, Plus{});
    });
}

/// Sums of lines side by side, at most most_tried of them, and how many values they are of. Returns how many voxels are
/// NaN.
template <class T> std::int64_t add_sums(Lines<T> const& lines, double* sum, double* count) {
    alignas(64) double before[most_tried];
    std::copy_n(sum, lines.pixels, before);
    fold_lines(lines, sum, Plus{});
    std::int64_t nan = 0;
    for (std::int64_t begin = 0; begin < lines.pixels; begin += most_again) {
        std::int64_t const end = std::min(begin + most_again, lines.pixels);
        for (std::int64_t i = begin; i < end; ++i) count[i] += static_cast<double>(lines.n);
        if (all_finite(sum + begin, end - begin)) continue;
        std::copy(before + begin, before + end, sum + begin);
        for (std::int64_t k = 0; k < lines.n; ++k)
            for (std::int64_t i = begin; i < end; ++i) {
                T const v = lines.first[k * lines.step + i * lines.pixel];
                sum[i] += is_nan(v) != 0 ? 0 : static_cast<double>(v);
                count[i] -= is_nan(v);
                nan += is_nan(v);
            }
    }
    return nan;
}

/// Adds voxels of `rows` rows to sums and to what each addition lost (Neumaier): several at a time, as results are
/// loaded and stored less often then.
template <int rows, class T> void add_with_losses_of(Lines<T> const& lines, std::int64_t k, ProjectionState& state) {
    T const* const from = lines.first + k * lines.step;
    double* const sum = state.value + lines.at;
    double* const lost = state.extra + lines.at;
    double* const count = state.count + lines.at;
    std::int64_t const pixel = lines.pixel, step = lines.step;
#pragma omp simd
    for (std::int64_t i = 0; i < lines.pixels; ++i) {
        double total = sum[i], losses = lost[i], values = count[i];
        for (int r = 0; r < rows; ++r) {
            auto const v = static_cast<double>(from[r * step + i * pixel]);
            double const w = v == v ? v : 0, s = total + w; // NOLINT(misc-redundant-expression): NaN
            bool const larger = std::abs(total) >= std::abs(w);
            double const large = larger ? total : w, small = larger ? w : total;
            double const rest = (large - s) + small;
            losses += rest - rest == 0 ? rest : 0; // infinities have none
            total = s;
            values += v == v ? 1 : 0; // NOLINT(misc-redundant-expression): NaN
        }
        sum[i] = total;
        lost[i] = losses;
        count[i] = values;
    }
}

/// Line i alone, whose sum would overflow: from there on it is of voxels times a power of two, whatever the slabs.
template <class T> void add_without_overflow(Lines<T> const& lines, std::int64_t i, ProjectionState& state) {
    std::size_t const at = lines.at + static_cast<std::size_t>(i);
    double total = state.value[at], lost = state.extra[at], count = state.count[at];
    double scale = state.scale[at] == 0 ? 1 : state.scale[at];
    for (std::int64_t k = 0; k < lines.n; ++k) {
        T const voxel = lines.first[i * lines.pixel + k * lines.step];
        if (is_nan(voxel) != 0) continue;
        double w = static_cast<double>(voxel) * scale, s = total + w;
        if (std::isinf(s) && std::isfinite(total) && std::isfinite(w)) {
            scale = scale_of_sums;
            total *= scale;
            lost *= scale;
            w *= scale;
            s = total + w;
        }
        bool const larger = std::abs(total) >= std::abs(w);
        double const large = larger ? total : w, small = larger ? w : total;
        double const rest = (large - s) + small;
        lost += std::isfinite(rest) ? rest : 0;
        total = s;
        count += 1;
    }
    state.value[at] = total;
    state.extra[at] = lost;
    state.count[at] = count;
    state.scale[at] = scale == 1 ? 0 : scale;
}

/// The sum of numbers of voxels, in any order: it is exact.
double sum_of_counts(double const* count, std::int64_t n) {
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (std::int64_t i = 0; i < n; ++i) sum += count[i];
    return sum;
}

/// Adds voxels of all lines. Returns how many are NaN.
template <class T> std::int64_t add_with_losses(Lines<T> const& lines, ProjectionState& state) {
    double* const count = state.count + lines.at;
    double const before = sum_of_counts(count, lines.pixels);
    std::int64_t k = 0;
    for (; k + 4 <= lines.n; k += 4) add_with_losses_of<4>(lines, k, state);
    for (; k < lines.n; ++k) add_with_losses_of<1>(lines, k, state);
    double const added = sum_of_counts(count, lines.pixels) - before;
    return lines.n * lines.pixels - static_cast<std::int64_t>(added);
}

/// Adds lines of which there may be more to come, at most most_tried of them. Returns the same.
template <class T> std::int64_t add_with_care(Lines<T> const& lines, ProjectionState& state) {
    double *const sum = state.value + lines.at, *const lost = state.extra + lines.at,
                  *const count = state.count + lines.at, *const scale = state.scale + lines.at;
    alignas(64) double sums[most_tried], losses[most_tried];
    std::copy_n(sum, lines.pixels, sums);
    std::copy_n(lost, lines.pixels, losses);
    std::int64_t const nan = add_with_losses(lines, state);
    double scales = 0; // that lines have: of others it is 0
#pragma omp simd reduction(+ : scales)
    for (std::int64_t i = 0; i < lines.pixels; ++i) scales += scale[i];
    if (scales == 0 && all_finite(sum, lines.pixels)) return nan;
    for (std::int64_t i = 0; i < lines.pixels; ++i) {
        if (scale[i] == 0 && (std::isfinite(sum[i]) || !std::isfinite(sums[i]))) continue;
        sum[i] = sums[i];
        lost[i] = losses[i];
        for (std::int64_t k = 0; k < lines.n; ++k)
            count[i] -= 1 - is_nan(lines.first[i * lines.pixel + k * lines.step]);
        add_without_overflow(lines, i, state);
    }
    return nan;
}

/// Sums of floats; those of float64 with what was lost.
template <class T> void add_floats(ProjectionState& state, ConstView in, Execution const& execution) {
    if (state.axis == 0 && state.extra == nullptr)
        return for_each_lines<T>(state, in, 1, execution, [&](Lines<T> const& line) {
            std::int64_t nan = 0;
            state.value[line.at] += sum_of_row<double>(line.first, line.n, nan);
            state.count[line.at] += static_cast<double>(line.n - nan);
            add_nan(state, nan);
        });
    if (state.extra == nullptr)
        return for_each_upright<T>(state, in, execution, [&](Lines<T> const& lines) {
            add_nan(state, add_sums(lines, state.value + lines.at, state.count + lines.at));
        });
    if (state.axis != 0)
        return for_each_upright<T>(state, in, execution,
                                   [&](Lines<T> const& lines) { add_nan(state, add_with_care(lines, state)); });
    for_each_upright<T>(
        state, in, execution, [&](Lines<T> const& lines) { add_nan(state, add_with_losses(lines, state)); },
        [&](Lines<T> const& rows) { // they are whole
            for (std::int64_t i = 0; i < rows.pixels; ++i) {
                std::size_t const at = rows.at + static_cast<std::size_t>(i);
                if (std::isfinite(state.value[at])) continue;
                state.value[at] = state.extra[at] = state.count[at] = 0;
                add_without_overflow(rows, i, state);
            }
        });
}

/// The results of a piece of a row of the image.
void finish_pixels(ProjectionState const& state, std::size_t at, std::int64_t n, double* to) {
    auto const length = static_cast<double>(state.dims[state.axis]);
    double const none = std::numeric_limits<double>::quiet_NaN();
    for (std::int64_t i = 0; i < n; ++i) {
        std::size_t const p = at + static_cast<std::size_t>(i);
        if (state.whole != nullptr) {
            to[i] = static_cast<double>(state.whole[p]) / length;
        } else if (state.wide != nullptr) {
            to[i] = static_cast<double>(state.wide[p]) / length;
        } else {
            double const scale = state.scale == nullptr || state.scale[p] == 0 ? 1 : state.scale[p],
                         count = state.count[p];
            double const sum = state.value[p] + (state.extra == nullptr ? 0 : state.extra[p]);
            if (state.kind == Projection::sum)
                to[i] = sum / scale;
            else if (count == 0)
                to[i] = none;
            else
                to[i] = (state.kind == Projection::std ? std::sqrt(state.extra[p] / count) : sum / count) / scale;
        }
    }
}

} // namespace

void project_add(ProjectionState& state, ConstView slab, Execution const& execution) {
    if (slab.box.empty()) return;
    slab.box.lower == Index3{} ? state.begin(Space::host) : state.use(Space::host);
    if (state.kind == Projection::std) return project_deviations(state, slab, execution);
    with_type(slab.type, [&]<class T>(T) {
        switch (state.kind) {
        case Projection::max:
        case Projection::min:
            return add_extremes<T>(state, slab, execution);
        default:
            if constexpr (std::is_integral_v<T>)
                return add_whole<T>(state, slab, execution);
            else
                return add_floats<T>(state, slab, execution);
        }
    });
}

void project_store(ProjectionState& state, AnyView out, Losses& losses, Execution const& execution) {
    state.use(Space::host);
    for_each_segment(execution, out.box, [&](std::int64_t x0, std::int64_t y, std::int64_t z, std::int64_t length) {
        Losses mine;
        for (std::int64_t x = x0; x < x0 + length; x += row_piece) {
            std::int64_t const n = std::min(row_piece, x0 + length - x);
            auto const at = static_cast<std::size_t>(y * state.row() + x);
            std::byte* const to = out.at(x, y, z);
            bool const sums = state.kind == Projection::sum;
            if (state.kind == Projection::max || state.kind == Projection::min) {
                if (out.type == DataType::float16)
                    mine += store_row(out.type, reinterpret_cast<float const*>(state.extremes) + at, to, n);
                else
                    std::memcpy(to, state.extremes + at * size_of(out.type),
                                static_cast<std::size_t>(n) * size_of(out.type));
            } else if (sums && state.wide != nullptr) {
                mine += store_row(out.type, state.wide + at, to, n);
            } else if (sums && state.whole != nullptr) { // as int64 it is what uint64 holds as well
                std::memcpy(to, state.whole + at, static_cast<std::size_t>(n) * 8);
            } else {
                alignas(64) double values[row_piece];
                finish_pixels(state, at, n, values);
                mine += store_row(out.type, static_cast<double const*>(values), to, n);
            }
        }
        driver::add(losses, mine);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
