// Projections: across rows pixels are the lanes of vectors and lines come one voxel after the other; along rows, which
// no slab cuts, voxels are. So results do not depend on where slabs end.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/project.h"

#include "libvkt/kernel/integer_sums.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/voxels/kernels/projected_lines.h"

#include <algorithm>
#include <cmath>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Pixels side by side that are worked on at a time: what is read of a row or a slice is long enough to be foreseen,
/// and of lines along z, whose next voxels are slices apart, much longer: 2048 floats took twice as long as 16384.
constexpr std::int64_t most_pixels = 16384;
/// Floats are taken for numbers first, which they mostly are; where the result of a line is not finite, once more from
/// what there was before. So many pixels are tried, and done again, together.
constexpr std::int64_t most_tried = 8192, most_again = 512;
template <class T> std::int64_t pixels_together(ProjectionState const& state) {
    bool const doubles = state.value != nullptr; // then there is more to a pixel
    return state.axis == 2 ? (doubles ? most_tried : most_pixels) : (8 << 10) / static_cast<std::int64_t>(sizeof(T));
}

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

/// True if the next voxels of lines are so far away that a processor does not foresee them.
template <class T> bool are_apart(Lines<T> const& lines) {
    return lines.step * static_cast<std::int64_t>(sizeof(T)) > 16384;
}

template <class T> std::int32_t is_nan(T voxel) {
    if constexpr (std::is_integral_v<T>) return 0;
    auto const v = static_cast<compute_t<T>>(voxel);
    return v != v ? 1 : 0; // NOLINT(misc-redundant-expression): NaN
}

template <class T> std::int64_t count_nan(Lines<T> const& lines) {
    std::int64_t nan = 0;
    for (std::int64_t k = 0; k < lines.n; ++k)
        for (std::int64_t begin = 0; begin < lines.pixels; begin += row_piece) {
            T const* const from = lines.first + k * lines.step + begin * lines.pixel;
            auto const n = static_cast<std::int32_t>(std::min(row_piece, lines.pixels - begin));
            std::int32_t here = 0;
#pragma omp simd reduction(+ : here)
            for (std::int32_t i = 0; i < n; ++i) here += is_nan(from[i * lines.pixel]);
            nan += here;
        }
    return nan;
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
#pragma GCC unroll 4
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
void add_nan(ProjectionState& state, std::int64_t nan) {
    if (nan == 0) return;
#pragma omp atomic
    state.nan += nan;
}

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

constexpr int row_lanes = 16;

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

/// Calls f(lines) for parts of the lines of at most `most` voxels, in order.
template <class T, class F> void in_parts(Lines<T> const& lines, std::int64_t most, F const& f) {
    Lines<T> part = lines;
    for (std::int64_t k = 0; k < lines.n; k += most) {
        part.first = lines.first + k * lines.step;
        part.n = std::min(most, lines.n - k);
        f(part);
    }
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

/// Sum and sum of squares of a row of small integers.
template <class T> IntegerSums<T> sums_along(T const* row, std::int64_t n) {
    IntegerSums<T> all;
    for (std::int64_t k = 0; k < n; k += most_integers) {
        IntegerSums<T> const part = integer_sums(row + k, std::min(most_integers, n - k));
        all.sum += part.sum;
        all.squares += part.squares;
    }
    return all;
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

/// Means and sums of squared deviations from them (Welford), and how many values they are of. The second difference is
/// from the mean as it was rounded: d * (d - d / n) would take that for exact, and cost large offsets half their
/// digits.
struct Spread {
    double mean = 0, squares = 0, count = 0;

    void add(double v) {
        double const d = v - mean;
        count += 1;
        mean += d * (1 / count);
        squares += d * (v - mean);
    }
};

/// Magnitudes whose squares, and differences of which, neither overflow nor lose bits. Values beyond them are
/// multiplied by a power of two, which is exact; a state that has come so far is, too.
constexpr double small_size = 0x1p-300, large_size = 0x1p300, far_scale = 0x1p700;
constexpr double scale_of_size(double size) {
    return size > large_size ? 1 / far_scale : size < small_size ? far_scale : 1;
}
/// Sums of squares below it may have lost bits, unless they are 0 for good reason.
constexpr double safe_squares = 0x1p-900;

/// The magnitude of a number, 0 of what is none.
template <class T> double size_of_number(T voxel) {
    double const size = std::abs(static_cast<double>(voxel));
    return size <= std::numeric_limits<double>::max() ? size : 0;
}

/// The spread of a row of numbers, in lanes that take turns. What is no number leaves none.
template <class T> Spread spread_of_numbers(T const* row, std::int64_t n) {
    Spread all;
    std::int64_t k = 0;
    if (n >= row_lanes) {
        using V = Vector<double>;
        constexpr int registers = row_lanes / static_cast<int>(V::lanes);
        V::type mean[registers] = {}, squares[registers] = {};
        double count = 0;
        for (; k + row_lanes <= n; k += row_lanes) {
            count += 1;
            double const share = 1 / count;
            __builtin_prefetch(row + k + 1024);
#pragma GCC unroll 8
            for (int r = 0; r < registers; ++r) {
                V::type const v = load_doubles(row + k + r * V::lanes);
                V::type const d = v - mean[r];
                mean[r] += d * share;
                squares[r] += d * (v - mean[r]);
            }
        }
        // Of two lanes together (Chan, Golub and LeVeque), which have as many values each.
        double means[row_lanes], sums[row_lanes];
        std::memcpy(means, mean, sizeof means);
        std::memcpy(sums, squares, sizeof sums);
        for (int half = row_lanes / 2; half > 0; half /= 2) {
            double const both = count + count, of_squares = count * count / both, of_mean = count / both;
            for (int j = 0; j < half; ++j) {
                double const d = means[j + half] - means[j];
                sums[j] = (sums[j] + sums[j + half]) + d * d * of_squares;
                means[j] += d * of_mean;
            }
            count = both;
        }
        all = {means[0], sums[0], count};
    }
    for (; k < n; ++k) all.add(static_cast<double>(row[k]));
    return all;
}

/// The same of any row: if some of it is no number, the others come one after the other.
template <class T> Spread spread_of_row(T const* row, std::int64_t n) {
    Spread const numbers = spread_of_numbers(row, n);
    if (numbers.squares - numbers.squares == 0) return numbers; // NOLINT(misc-redundant-expression): NaN
    std::int64_t nan = 0;
    for (std::int64_t k = 0; k < n; ++k) nan += is_nan(row[k]);
    if (nan == 0) return numbers;
    Spread spread;
    for (std::int64_t k = 0; k < n; ++k)
        if (is_nan(row[k]) == 0) spread.add(static_cast<double>(row[k]));
    return spread;
}

/// The same of any float64, and the power of two that they were multiplied by.
struct ScaledSpread {
    Spread spread;
    double scale;
};
ScaledSpread scaled_spread_of_row(double const* row, std::int64_t n) {
    Spread const plain = spread_of_row(row, n);
    if (plain.squares >= safe_squares && plain.squares <= std::numeric_limits<double>::max()) return {plain, 1};
    double most = 0;
#pragma omp simd reduction(max : most)
    for (std::int64_t i = 0; i < n; ++i) most = std::max(most, size_of_number(row[i]));
    double const scale = most > 0 ? scale_of_size(most) : 1;
    if (scale == 1) return {plain, 1};
    std::vector<double> scaled(row, row + n);
    for (double& v : scaled) v *= scale;
    return {spread_of_row(static_cast<double const*>(scaled.data()), n), scale};
}

/// Pixels side by side, their means and sums of squares so far, and of how many values they are.
struct Deviations {
    double *mean, *squares, *count;
    double* scale; ///< null unless values are float64
    std::int64_t pixels;

    Deviations part(std::int64_t begin, std::int64_t n) const {
        return {mean + begin, squares + begin, count + begin, scale == nullptr ? nullptr : scale + begin, n};
    }
    bool is_scaled() const {
        return scale != nullptr && std::any_of(scale, scale + pixels, [](double s) { return s != 0; });
    }
};

/// Adds voxels of `rows` rows, `step` from one another, to pixels that have `count` values each: several at a time, so
/// that results are loaded and stored less often. What is no number leaves sums of squares that are none. `ahead`: asks
/// for what follows, since several rows that follow one another are not foreseen.
template <int rows, bool ahead = false, class T>
void add_numbers(T const* from, std::int64_t step, Deviations const& to, double count) {
    double share[rows];
    for (int r = 0; r < rows; ++r) share[r] = 1 / (count + (r + 1));
    auto const add = [](auto v, double of, auto& m, auto& q) {
        auto const d = v - m;
        m += d * of;
        q += d * (v - m);
    };
    constexpr std::int64_t lanes = lane_count<double>;
    std::int64_t i = 0;
    for (; i + lanes <= to.pixels; i += lanes) {
        Lanes<double> m = load_lanes(to.mean + i), q = load_lanes(to.squares + i);
        if constexpr (ahead)
            for (std::size_t byte = 0; byte < rows * lanes * sizeof(T); byte += 64)
                __builtin_prefetch(reinterpret_cast<std::byte const*>(from + rows * (step + i)) + byte);
#pragma GCC unroll 8
        for (int r = 0; r < rows; ++r) add(load_doubles(from + r * step + i), share[r], m, q);
        store_lanes(to.mean + i, m);
        store_lanes(to.squares + i, q);
    }
    for (; i < to.pixels; ++i)
        for (int r = 0; r < rows; ++r)
            add(static_cast<double>(from[r * step + i]), share[r], to.mean[i], to.squares[i]);
}

/// Adds those voxels of a row that are numbers. Multiplied by 1 / n, not divided by n, like all others. Returns how
/// many are none.
template <bool scaled = false, class T> std::int64_t add_some_numbers(T const* from, Deviations const& to) {
    std::int32_t nan = 0;
#pragma omp simd reduction(+ : nan)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(to.pixels); ++i) {
        auto v = static_cast<double>(from[i]);
        if constexpr (scaled) v *= to.scale[i] == 0 ? 1 : to.scale[i];
        bool const is = v == v; // NOLINT(misc-redundant-expression): NaN
        double const n = to.count[i] + (is ? 1 : 0), d = v - to.mean[i], m = to.mean[i] + d * (1 / n);
        to.squares[i] += is ? d * (v - m) : 0;
        to.mean[i] = is ? m : to.mean[i];
        to.count[i] = n;
        nan += is ? 0 : 1;
    }
    return nan;
}

/// Brings at most most_again pixels to the scale that they need together with the next voxels of their lines. Returns
/// whether one of them has another than 1.
template <class T> bool rescale(T const* from, Lines<T> const& lines, Deviations const& to) {
    double most[most_again] = {};
    for (std::int64_t k = 0; k < lines.n; ++k) {
        T const* const row = from + k * lines.step;
#pragma omp simd
        for (std::int64_t i = 0; i < to.pixels; ++i) most[i] = std::max(most[i], size_of_number(row[i]));
    }
    bool scaled = false;
    for (std::int64_t i = 0; i < to.pixels; ++i) {
        double const before = to.scale[i] == 0 ? 1 : to.scale[i];
        double const so_far = std::max(std::abs(to.mean[i]), std::sqrt(to.squares[i])) / before;
        double const size = std::max(most[i], so_far <= std::numeric_limits<double>::max() ? so_far : 0);
        double const after = size > 0 ? scale_of_size(size) : before, factor = after / before;
        to.mean[i] *= factor;
        to.squares[i] *= factor;
        to.squares[i] *= factor;
        to.scale[i] = after == 1 ? 0 : after;
        scaled = scaled || after != 1;
    }
    return scaled;
}

/// Lines side by side, at most most_tried of them. Returns how many voxels are NaN.
template <class T> std::int64_t add_lines(Lines<T> const& lines, Deviations const& to) {
    alignas(64) double mean[most_tried], squares[most_tried];
    double const count = to.count[0];
    bool const same =
        !to.is_scaled() && std::all_of(to.count, to.count + to.pixels, [&](double n) { return n == count; });
    if (same) {
        std::copy_n(to.mean, to.pixels, mean);
        std::copy_n(to.squares, to.pixels, squares);
        std::int64_t k = 0;
        for (; are_apart(lines) && k + 8 <= lines.n; k += 8)
            add_numbers<8>(lines.first + k * lines.step, lines.step, to, count + static_cast<double>(k));
        for (; k + 4 <= lines.n; k += 4) {
            T const* const rows = lines.first + k * lines.step;
            if (are_apart(lines))
                add_numbers<4>(rows, lines.step, to, count + static_cast<double>(k));
            else
                add_numbers<4, true>(rows, lines.step, to, count + static_cast<double>(k));
        }
        for (; k < lines.n; ++k)
            add_numbers<1>(lines.first + k * lines.step, lines.step, to, count + static_cast<double>(k));
    }
    std::int64_t nan = 0;
    for (std::int64_t begin = 0; begin < to.pixels; begin += most_again) {
        Deviations const part = to.part(begin, std::min(most_again, to.pixels - begin));
        T const* const from = lines.first + begin;
        bool const finite = same && all_finite(part.squares, part.pixels);
        auto const keep = [&] { std::fill_n(part.count, part.pixels, count + static_cast<double>(lines.n)); };
        bool const safe = part.scale == nullptr || std::all_of(part.squares, part.squares + part.pixels,
                                                               [](double sum) { return sum >= safe_squares; });
        if (finite && safe) {
            keep();
            continue;
        }
        double tried_mean[most_again], tried_squares[most_again];
        if (same) {
            std::copy_n(part.mean, part.pixels, tried_mean);
            std::copy_n(part.squares, part.pixels, tried_squares);
            std::copy_n(mean + begin, part.pixels, part.mean);
            std::copy_n(squares + begin, part.pixels, part.squares);
        }
        bool const scaled = part.scale != nullptr && rescale(from, lines, part);
        if (finite && !scaled) { // sums of squares of what is constant
            std::copy_n(tried_mean, part.pixels, part.mean);
            std::copy_n(tried_squares, part.pixels, part.squares);
            keep();
            continue;
        }
        for (std::int64_t k = 0; k < lines.n; ++k)
            nan += scaled ? add_some_numbers<true>(from + k * lines.step, part)
                          : add_some_numbers(from + k * lines.step, part);
    }
    return nan;
}

/// Small integers: sums and sums of squares are exact, also as doubles, until the last voxel of a line has come, and
/// become a mean and a sum of squared deviations of one rounding each.
constexpr std::int64_t most_squares = std::int64_t{1} << 21; // of 16 bits, whose sum double holds

void finish_spread(double& sum, double& squares, double& count, double n) {
    auto const s = static_cast<Int128>(sum), q = static_cast<Int128>(squares);
    squares = static_cast<double>(q * static_cast<Int128>(n) - s * s) / n;
    sum /= n;
    count = n;
}

/// Adds voxels and their squares, of `together` rows at once: storing results takes longest.
template <int together, class T, class Q>
void add_rows_of_squares(Lines<T> const& lines, std::int64_t k, std::int32_t* sums, Q* squares) {
    T const* const first = lines.first + k * lines.step;
    std::int64_t const step = lines.step;
#pragma omp simd
    for (std::int64_t i = 0; i < lines.pixels; ++i) {
        std::int32_t sum = 0;
        Q square = 0;
        for (int row = 0; row < together; ++row) {
            std::int32_t const v = first[row * step + i];
            std::uint32_t const size = static_cast<std::uint32_t>(v); // negative ones wrap, and their squares back
            sum += v;
            square += static_cast<Q>(size * size);
        }
        sums[i] += sum;
        squares[i] += square;
    }
}

template <class T> void add_small_squares(ProjectionState& state, ConstView in, Execution const& execution) {
    bool const last = in.box.upper[state.axis] == state.dims[state.axis];
    auto const length = static_cast<double>(state.dims[state.axis]);
    if (state.axis == 0)
        return for_each_lines<T>(state, in, 1, execution, [&](Lines<T> const& line) {
            IntegerSums<T> const sums = sums_along(line.first, line.n);
            state.value[line.at] = static_cast<double>(sums.sum);
            state.extra[line.at] = static_cast<double>(sums.squares);
            finish_spread(state.value[line.at], state.extra[line.at], state.count[line.at], length);
        });
    using Squares = std::conditional_t<sizeof(T) == 1, std::uint32_t, std::uint64_t>;
    for_each_lines<T>(state, in, pixels_together<T>(state), execution, [&](Lines<T> const& lines) {
        alignas(64) std::int32_t sums[most_pixels];
        alignas(64) Squares squares[most_pixels];
        in_parts(lines, 32768, [&](Lines<T> const& part) {
            std::fill_n(sums, lines.pixels, 0);
            std::fill_n(squares, lines.pixels, Squares{0});
            std::int64_t k = 0;
            for (; k + 4 <= part.n; k += 4)
                add_rows_of_squares<4>(part, k, static_cast<std::int32_t*>(sums), static_cast<Squares*>(squares));
            for (; k < part.n; ++k)
                add_rows_of_squares<1>(part, k, static_cast<std::int32_t*>(sums), static_cast<Squares*>(squares));
            for (std::int64_t i = 0; i < lines.pixels; ++i) {
                auto const p = lines.at + static_cast<std::size_t>(i);
                state.value[p] += static_cast<double>(sums[i]);
                state.extra[p] += static_cast<double>(squares[i]);
            }
        });
        if (!last) return;
        for (std::size_t p = lines.at; p < lines.at + static_cast<std::size_t>(lines.pixels); ++p)
            finish_spread(state.value[p], state.extra[p], state.count[p], length);
    });
}

/// Which voxels come together makes no difference.
template <class T> void add_deviations(ProjectionState& state, ConstView in, Execution const& execution) {
    if constexpr (std::is_integral_v<T> && sizeof(T) <= 2)
        if (state.dims[state.axis] <= most_squares) return add_small_squares<T>(state, in, execution);
    if (state.axis == 0)
        return for_each_lines<T>(state, in, 1, execution, [&](Lines<T> const& line) {
            Spread spread;
            if constexpr (std::is_same_v<T, double>) {
                ScaledSpread const scaled = scaled_spread_of_row(line.first, line.n);
                spread = scaled.spread;
                state.scale[line.at] = scaled.scale == 1 ? 0 : scaled.scale;
            } else {
                spread = spread_of_row(line.first, line.n);
            }
            state.value[line.at] = spread.mean;
            state.extra[line.at] = spread.squares;
            state.count[line.at] = spread.count;
            add_nan(state, line.n - static_cast<std::int64_t>(spread.count));
        });
    for_each_lines<T>(state, in, pixels_together<T>(state), execution, [&](Lines<T> const& lines) {
        double* const mean = state.value + lines.at;
        double* const scale = state.scale == nullptr ? nullptr : state.scale + lines.at;
        add_nan(state, add_lines(lines, {mean, state.extra + lines.at, state.count + lines.at, scale, lines.pixels}));
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
    with_type(slab.type, [&]<class T>(T) {
        switch (state.kind) {
        case Projection::max:
        case Projection::min:
            return add_extremes<T>(state, slab, execution);
        case Projection::std:
            return add_deviations<T>(state, slab, execution);
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
