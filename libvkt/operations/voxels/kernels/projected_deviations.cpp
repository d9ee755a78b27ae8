// Means and sums of squared deviations of lines of voxels; of small integers their sums and sums of squares.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/projected_deviations.h"

#include "libvkt/kernel/integer_sums.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/voxels/kernels/projected_lines.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

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

} // namespace

void project_deviations(ProjectionState& state, ConstView slab, Execution const& execution) {
    with_type(slab.type, [&]<class T>(T) { add_deviations<T>(state, slab, execution); });
}

} // namespace VKT_BACKEND
} // namespace vkt
