// Projections: across rows pixels are the lanes of vectors and lines come one voxel after the other; along rows, which
// no slab cuts, voxels are. So results do not depend on where slabs end.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/project.h"

#include "libvkt/kernel/integer_sums.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/operations/kernels/projected_lines.h"

#include <algorithm>
#include <cmath>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// to[j * pixels + i] = from[i * row + j] for i < pixels, j < n; `pixels` is a multiple of every block's edge.
template <class T> void turn(T const* from, std::int64_t row, std::int64_t pixels, std::int64_t n, T* to) {
    for_each_size(sizeof(T), [&]<class U>(U) {
        if constexpr (sizeof(U) == sizeof(T)) {
            constexpr std::int64_t edge = block_edge<U>;
            std::int64_t const whole = n / edge * edge;
            for (std::int64_t i = 0; i < pixels; i += edge)
                for (std::int64_t j = 0; j < whole; j += edge)
                    transpose_block(reinterpret_cast<U const*>(from + i * row + j), row,
                                    reinterpret_cast<U*>(to + j * pixels + i), pixels);
            for (std::int64_t j = whole; j < n; ++j)
                for (std::int64_t i = 0; i < pixels; ++i) to[j * pixels + i] = from[i * row + j];
        }
    });
}

/// Pixels side by side that are worked on at a time: what is read of a slice is long enough to be foreseen.
template <class T> constexpr std::int64_t most_pixels = (8 << 10) / static_cast<std::int64_t>(sizeof(T));

/// The same as for_each_lines(), with pixels side by side: lines along rows are turned, a few at a time.
template <class T, class F>
void for_each_upright(ProjectionState const& state, ConstView in, Execution const& execution, F const& f) {
    if (state.axis != 0) return for_each_lines<T>(state, in, most_pixels<T>, execution, f);
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
    });
}

/// Pixels of lines of which some voxels each, in the first cache, are looked at more than once.
constexpr std::int64_t most_in_blocks = 512;

/// Calls f(Lines) for parts of the lines that stay in the first cache, in order.
template <class T, class F> void in_blocks(Lines<T> const& lines, F const& f) {
    std::int64_t const most = std::max<std::int64_t>(4, (16 << 10) / static_cast<int>(sizeof(T)) / lines.pixels);
    Lines<T> part = lines;
    for (std::int64_t k = 0; k < lines.n; k += most) {
        part.first = lines.first + k * lines.step;
        part.n = std::min(most, lines.n - k);
        f(part);
    }
}

/// True if the next voxels of lines are so far away that a processor does not foresee them.
template <class T> bool are_apart(Lines<T> const& lines) {
    return lines.step * static_cast<std::int64_t>(sizeof(T)) > 16384;
}

/// acc[i] = f(acc[i], voxel) for all voxels of the lines. The functor arrives by value, as in the drivers.
template <class A, class T, class F> void fold_lines(Lines<T> const& lines, A* acc, F const f) {
    std::int64_t const pixels = lines.pixels, step = lines.step;
    if (lines.pixel != 1) {
        for (std::int64_t k = 0; k < lines.n; ++k)
            for (std::int64_t i = 0; i < pixels; ++i) acc[i] = f(acc[i], lines.first[k * step + i * lines.pixel]);
        return;
    }
    // Rows that follow one another come one by one, which processors foresee; of those that are slices apart, several
    // at once, each a stream of its own.
    std::int64_t k = 0;
    for (; are_apart(lines) && k + 4 <= lines.n; k += 4) {
        T const* const a = lines.first + k * step;
        T const *const b = a + step, *const c = b + step, *const d = c + step;
#pragma omp simd
        for (std::int64_t i = 0; i < pixels; ++i) acc[i] = f(f(f(f(acc[i], a[i]), b[i]), c[i]), d[i]);
    }
    for (; k < lines.n; ++k) {
        T const* const a = lines.first + k * step;
#pragma omp simd
        for (std::int64_t i = 0; i < pixels; ++i) acc[i] = f(acc[i], a[i]);
    }
}

template <class A> struct Larger {
    template <class T> VKT_HD A operator()(A a, T voxel) const {
        A const v = static_cast<A>(voxel);
        bool const first = a != a; // NOLINT(misc-redundant-expression): NaN is no value, but what there is at first
        return ((v > a) | first) ? v : a; // no ||: a branch for each of several lines would not be a vector
    }
};
template <class A> struct Smaller {
    template <class T> VKT_HD A operator()(A a, T voxel) const {
        A const v = static_cast<A>(voxel);
        bool const first = a != a; // NOLINT(misc-redundant-expression): NaN is no value, but what there is at first
        return ((v < a) | first) ? v : a;
    }
};
template <class A> struct Plus {
    template <class T> VKT_HD A operator()(A a, T voxel) const { return static_cast<A>(a + static_cast<A>(voxel)); }
};

template <class T> [[gnu::noinline]] std::int64_t nan_in_row(T const* row, std::int64_t n) {
    std::int64_t nan = 0;
    for (std::int64_t begin = 0; begin < n; begin += row_piece) {
        auto const m = static_cast<std::int32_t>(std::min(row_piece, n - begin));
        T const* const from = row + begin;
        std::int32_t here = 0;
#pragma omp simd reduction(+ : here)
        for (std::int32_t i = 0; i < m; ++i) {
            auto const v = static_cast<compute_t<T>>(from[i]);
            here += v != v ? 1 : 0; // NOLINT(misc-redundant-expression): NaN
        }
        nan += here;
    }
    return nan;
}

template <class T> std::int64_t count_nan(Lines<T> const& lines) {
    std::int64_t nan = 0;
    if (lines.pixel == 1)
        for (std::int64_t k = 0; k < lines.n; ++k) nan += nan_in_row(lines.first + k * lines.step, lines.pixels);
    else // along rows
        for (std::int64_t i = 0; i < lines.pixels; ++i) nan += nan_in_row(lines.first + i * lines.pixel, lines.n);
    return nan;
}

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

/// The extreme of a row of numbers, as if its voxels were looked at one after the other.
template <class A, class Best> A extreme_of_row(A const* row, std::int64_t n, Best const best) {
    using V = Vector<A>;
    constexpr std::int64_t together = 4 * V::lanes;
    A result = row[0];
    std::int64_t k = 1;
    if (n >= together) {
        typename V::type most[4];
#pragma GCC unroll 4
        for (int r = 0; r < 4; ++r) most[r] = V::load(row + r * V::lanes);
        for (k = together; k + together <= n; k += together)
#pragma GCC unroll 4
            for (int r = 0; r < 4; ++r) {
                typename V::type const v = V::load(row + k + r * V::lanes);
                most[r] = best.picks(most[r], v) ? v : most[r];
            }
        for (auto const& lanes : most)
            for (std::int64_t i = 0; i < V::lanes; ++i) result = best(result, lanes[i]);
    }
    for (; k < n; ++k) result = best(result, row[k]);
    if constexpr (std::is_floating_point_v<A>)
        if (result == A(0)) result = *std::find(row, row + n, A(0)); // lanes do not know which zero came first
    return result;
}

/// Adds the extremes of lines without NaN: each is found first, and then compared with what there is.
template <class A, class T, class Fold, class Best>
void add_extremes_of(Lines<T> const& lines, A* image, Fold const fold, Best const best) {
    alignas(64) A found[most_pixels<T>];
    if constexpr (std::is_same_v<A, T>) {
        if (lines.pixel == 1) {
            Lines<T> rest = lines;
            std::copy_n(lines.first, lines.pixels, found);
            rest.first += lines.step;
            --rest.n;
            fold_lines(rest, static_cast<A*>(found), best);
        } else {
            for (std::int64_t i = 0; i < lines.pixels; ++i)
                found[i] = extreme_of_row(lines.first + i * lines.pixel, lines.n, best);
        }
        Lines<A> const one{found, 1, 0, 1, lines.at, lines.pixels};
        return fold_lines(one, image + lines.at, fold);
    }
    fold_lines(lines, image + lines.at, fold);
}

template <class T> void add_extremes(ProjectionState& state, ConstView in, Execution const& execution) {
    using A = std::conditional_t<std::is_same_v<T, Half>, float, T>;
    auto* const image = reinterpret_cast<A*>(state.extremes);
    auto const add = [&](Lines<T> const& lines) {
        std::int64_t nan = 0;
        if constexpr (!std::is_integral_v<T>) add_nan(state, nan = count_nan(lines));
        auto const with = [&](auto const fold, auto const best) {
            if (nan == 0)
                add_extremes_of(lines, image, fold, best);
            else
                fold_lines(lines, image + lines.at, fold);
        };
        if (state.kind == Projection::max)
            with(Larger<A>{}, Above{});
        else
            with(Smaller<A>{}, Below{});
    };
    if (state.axis == 0) return for_each_lines<T>(state, in, 4, execution, add);
    if constexpr (std::is_integral_v<T>) return for_each_lines<T>(state, in, most_pixels<T>, execution, add);
    for_each_lines<T>(state, in, most_in_blocks, execution, [&](Lines<T> const& lines) { in_blocks(lines, add); });
}

/// What lanes that take turns along a row have in the end, added up in pairs.
constexpr int row_lanes = 16;
template <class A> A sum_of_lanes(A (&lanes)[row_lanes]) {
    for (int half = row_lanes / 2; half > 0; half /= 2)
        for (int j = 0; j < half; ++j) lanes[j] += lanes[j + half];
    return lanes[0];
}

/// The sum of a row, its numbers in lanes that take turns: the same ones whatever the registers hold. What is no number
/// adds nothing.
template <class A, class T> A sum_of_row(T const* row, std::int64_t n) {
    A sums[row_lanes] = {};
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
        for (int j = 0; j < row_lanes; ++j) sums[j] += value(row[k + j]);
    for (int j = 0; k < n; ++k, ++j) sums[j] += value(row[k]);
    return sum_of_lanes(sums);
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
    alignas(64) std::int32_t sums[most_pixels<T>];
    in_parts(lines, 32768, [&](Lines<T> const& long_part) {
        std::fill_n(sums, lines.pixels, 0);
        if constexpr (sizeof(T) == 1) {
            alignas(64) std::int16_t few[most_pixels<T>];
            in_parts(long_part, 128, [&](Lines<T> const& part) {
                std::fill_n(few, lines.pixels, std::int16_t{0});
                fold_lines(part, static_cast<std::int16_t*>(few), Plus<std::int16_t>{});
                for (std::int64_t i = 0; i < lines.pixels; ++i) sums[i] += few[i];
            });
        } else {
            fold_lines(long_part, static_cast<std::int32_t*>(sums), Plus<std::int32_t>{});
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
            if constexpr (sizeof(T) <= 2)
                state.whole[line.at] += sums_along(line.first, line.n).sum;
            else
                state.whole[line.at] += sum_of_row<std::int64_t>(line.first, line.n);
        });
    for_each_upright<T>(state, in, execution, [&](Lines<T> lines) {
        if (state.wide != nullptr) return fold_lines(lines, state.wide + lines.at, Plus<Int128>{});
        if constexpr (sizeof(T) <= 2)
            add_small(lines, state.whole + lines.at);
        else
            fold_lines(lines, state.whole + lines.at, Plus<std::int64_t>{});
    });
}

template <class A> bool all_finite(A const* values, std::int64_t n) {
    A odd = 0;
#pragma omp simd reduction(+ : odd)
    for (std::int64_t i = 0; i < n; ++i) odd += values[i] - values[i]; // NOLINT(misc-redundant-expression): NaN, too
    return odd == A(0);
}

/// Sums of floats; those of float64 with what each addition lost (Neumaier).
template <class T> void add_floats(ProjectionState& state, ConstView in, Execution const& execution) {
    if (state.axis == 0 && state.extra == nullptr)
        return for_each_lines<T>(state, in, 1, execution, [&](Lines<T> const& line) {
            std::int64_t const nan = nan_in_row(line.first, line.n);
            add_nan(state, nan);
            state.value[line.at] += sum_of_row<double>(line.first, line.n);
            state.count[line.at] += static_cast<double>(line.n - nan);
        });
    auto const add = [&](Lines<T> const& lines) {
        double* const sum = state.value + lines.at;
        double* const lost = state.extra == nullptr ? nullptr : state.extra + lines.at;
        double* const count = state.count + lines.at;
        std::int64_t const nan = count_nan(lines);
        add_nan(state, nan);
        if (lost == nullptr && nan == 0) {
            fold_lines(lines, sum, Plus<double>{});
            for (std::int64_t i = 0; i < lines.pixels; ++i) count[i] += static_cast<double>(lines.n);
            return;
        }
        for (std::int64_t k = 0; k < lines.n; ++k) {
            T const* const from = lines.first + k * lines.step;
            std::int64_t const pixel = lines.pixel;
            if (lost == nullptr) {
#pragma omp simd
                for (std::int64_t i = 0; i < lines.pixels; ++i) {
                    auto const v = static_cast<double>(from[i * pixel]);
                    sum[i] += v == v ? v : 0;
                    count[i] += v == v ? 1 : 0;
                }
                continue;
            }
#pragma omp simd
            for (std::int64_t i = 0; i < lines.pixels; ++i) {
                auto const v = static_cast<double>(from[i * pixel]);
                double const w = v == v ? v : 0, a = sum[i], s = a + w;
                double const large = std::abs(a) >= std::abs(w) ? a : w, small = std::abs(a) >= std::abs(w) ? w : a;
                double const rest = (large - s) + small;
                lost[i] += rest - rest == 0 ? rest : 0; // infinities have none
                sum[i] = s;
                count[i] += v == v ? 1 : 0;
            }
        }
    };
    for_each_upright<T>(state, in, execution, [&](Lines<T> const& lines) {
        if (state.extra == nullptr) {
            // NaN and infinities leave a sum that is not finite: voxels are looked at only then.
            alignas(64) double sums[most_pixels<T>];
            std::copy_n(state.value + lines.at, lines.pixels, sums);
            fold_lines(lines, static_cast<double*>(sums), Plus<double>{});
            if (all_finite(static_cast<double const*>(sums), lines.pixels)) {
                std::copy_n(sums, lines.pixels, state.value + lines.at);
                for (std::int64_t i = 0; i < lines.pixels; ++i)
                    state.count[lines.at + static_cast<std::size_t>(i)] += static_cast<double>(lines.n);
                return;
            }
        }
        in_blocks(lines, add);
    });
}

/// Means and sums of squared deviations from them (Welford), and how many values they are of.
struct Spread {
    double mean = 0, squares = 0, count = 0;

    void add(double v) {
        double const d = v - mean;
        count += 1;
        mean += d * (1 / count);
        squares += d * (v - mean);
    }
    /// Of both together (Chan, Golub and LeVeque).
    void merge(Spread const& other) {
        if (other.count == 0) return;
        double const d = other.mean - mean, n = count + other.count;
        squares = (squares + other.squares) + d * d * (count * other.count / n);
        mean += d * (other.count / n);
        count = n;
    }
};

/// The spread of a row, its numbers in lanes that take turns. What is no number is left out: then voxels come one after
/// the other.
template <class T> Spread spread_of_row(T const* row, std::int64_t n, bool numbers) {
    Spread all;
    std::int64_t k = 0;
    if (numbers && n >= row_lanes) {
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
                V::type const d = v - mean[r], m = mean[r] + d * share;
                squares[r] += d * (v - m);
                mean[r] = m;
            }
        }
        Spread lanes[row_lanes];
        for (int j = 0; j < row_lanes; ++j)
            lanes[j] = {mean[j / V::lanes][j % V::lanes], squares[j / V::lanes][j % V::lanes], count};
        for (int half = row_lanes / 2; half > 0; half /= 2)
            for (int j = 0; j < half; ++j) lanes[j].merge(lanes[j + half]);
        all = lanes[0];
    }
    for (; k < n; ++k) {
        auto const v = static_cast<double>(row[k]);
        if (v == v) all.add(v); // NOLINT(misc-redundant-expression): NaN
    }
    return all;
}

/// The same of lines side by side, `count` values each so far: several voxels of each at a time, so that results are
/// loaded and stored less often.
template <int together, class T>
void add_upright_deviations(Lines<T> const& lines, std::int64_t k, double* mean, double* squares, double count) {
    T const* const first = lines.first + k * lines.step;
    std::int64_t const step = lines.step;
    double const a = 1 / (count + 1), b = 1 / (count + 2), c = 1 / (count + 3), d = 1 / (count + 4);
#pragma omp simd
    for (std::int64_t i = 0; i < lines.pixels; ++i) {
        double m = mean[i], q = squares[i];
        auto const add = [&](std::int64_t j, double share) {
            auto const v = static_cast<double>(first[j * step + i]);
            double const off = v - m;
            m += off * share;
            q += off * (v - m);
        };
        add(0, a);
        if constexpr (together > 1) {
            add(1, b);
            add(2, c);
            add(3, d);
        }
        mean[i] = m;
        squares[i] = q;
    }
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
    for_each_lines<T>(state, in, most_pixels<T>, execution, [&](Lines<T> const& lines) {
        alignas(64) std::int32_t sums[most_pixels<T>];
        alignas(64) Squares squares[most_pixels<T>];
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

/// Multiplied by 1 / n, not divided by n: always, so that it does not matter which voxels come together.
template <class T> void add_deviations(ProjectionState& state, ConstView in, Execution const& execution) {
    if constexpr (std::is_integral_v<T> && sizeof(T) <= 2)
        if (state.dims[state.axis] <= most_squares) return add_small_squares<T>(state, in, execution);
    auto const missing = [&](Lines<T> const& lines) {
        if constexpr (std::is_integral_v<T>) return std::int64_t{0};
        std::int64_t const nan = count_nan(lines);
        add_nan(state, nan);
        return nan;
    };
    if (state.axis == 0)
        return for_each_lines<T>(state, in, 1, execution, [&](Lines<T> const& line) {
            bool const numbers = missing(line) == 0;
            Spread const spread = spread_of_row(line.first, line.n, numbers);
            state.value[line.at] = spread.mean;
            state.extra[line.at] = spread.squares;
            state.count[line.at] = spread.count;
        });
    auto const add = [&](Lines<T> const& lines) {
        double* const mean = state.value + lines.at;
        double* const squares = state.extra + lines.at;
        double* const count = state.count + lines.at;
        std::int32_t others = 0;
#pragma omp simd reduction(+ : others)
        for (std::int32_t i = 0; i < static_cast<std::int32_t>(lines.pixels); ++i)
            others += count[i] != count[0] ? 1 : 0;
        if (missing(lines) == 0 && others == 0) {
            std::int64_t k = 0;
            double const n = count[0];
            for (; k + 4 <= lines.n; k += 4)
                add_upright_deviations<4>(lines, k, mean, squares, n + static_cast<double>(k));
            for (; k < lines.n; ++k) add_upright_deviations<1>(lines, k, mean, squares, n + static_cast<double>(k));
            std::fill_n(count, lines.pixels, n + static_cast<double>(lines.n));
            return;
        }
        for (std::int64_t k = 0; k < lines.n; ++k) {
            T const* const from = lines.first + k * lines.step;
#pragma omp simd
            for (std::int64_t i = 0; i < lines.pixels; ++i) {
                auto const v = static_cast<double>(from[i]);
                bool const is = v == v; // NOLINT(misc-redundant-expression): NaN
                double const n = count[i] + (is ? 1 : 0), d = v - mean[i], m = mean[i] + d * (1 / n);
                squares[i] += is ? d * (v - m) : 0;
                mean[i] = is ? m : mean[i];
                count[i] = n;
            }
        }
    };
    for_each_lines<T>(state, in, most_in_blocks, execution, [&](Lines<T> const& lines) { in_blocks(lines, add); });
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
        } else if (state.kind == Projection::std) {
            to[i] = state.count[p] > 0 ? std::sqrt(state.extra[p] / state.count[p]) : none;
        } else {
            double const sum = state.value[p] + (state.extra == nullptr ? 0 : state.extra[p]);
            to[i] = state.kind == Projection::sum ? sum : state.count[p] > 0 ? sum / state.count[p] : none;
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
