// Comparing rows.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/difference.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"

#include <cmath>
#include <limits>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int lanes = 16;
constexpr double infinity = std::numeric_limits<double>::infinity();

/// to[i] = |a[i] - b[i]|; 0 for equal infinities and pairs of NaN, infinity for NaN against a number.
void absolute_differences(double const* a, double const* b, double* to, std::int64_t n) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        double const d = a[i] < b[i] ? b[i] - a[i] : a[i] - b[i];
        bool const equal = a[i] == b[i] || (a[i] != a[i] && b[i] != b[i]);
        to[i] = equal ? 0 : d == d ? d : infinity;
    }
}

double distance(Int128 a, Int128 b) { return static_cast<double>(a < b ? b - a : a - b); }
double distance(Int128 a, double b) {
    if (b != b) return infinity;
    if (!(std::abs(b) < 0x1p100)) return std::abs(b - static_cast<double>(a));
    Int128 const whole = static_cast<Int128>(b);
    return std::abs(static_cast<double>(a - whole) - (b - static_cast<double>(whole)));
}

/// The same for 64-bit integers, whose differences from one another and from doubles double would not see.
template <class T, class U> void exact_differences(T const* a, U const* b, double* to, std::int64_t n, double slope) {
    using B = std::conditional_t<std::is_integral_v<U>, Int128, double>;
    for (std::int64_t i = 0; i < n; ++i)
        to[i] = std::abs(slope) * distance(static_cast<Int128>(a[i]), static_cast<B>(b[i]));
}

bool is_wide(DataType type) { return type == DataType::int64 || type == DataType::uint64; }

/// Calls f with the row of 64-bit integers that begins at `from`.
template <class F> void with_wide(DataType type, std::byte const* from, F&& f) {
    if (type == DataType::int64) return f(reinterpret_cast<std::int64_t const*>(from));
    f(reinterpret_cast<std::uint64_t const*>(from));
}

void map_values(double* v, std::int64_t n, ValueMap const& map) {
    if (map == ValueMap{}) return;
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) v[i] = map.slope * v[i] + map.intercept;
}

struct RowSums {
    double squares[lanes] = {}, largest[lanes] = {}, low[lanes], high[lanes];
};

void accumulate(double const* d, double const* a, std::int64_t n, RowSums& sums) {
    std::int64_t i = 0;
    for (; i + lanes <= n; i += lanes) {
#pragma omp simd
        for (int j = 0; j < lanes; ++j) {
            double const v = a[i + j], e = d[i + j];
            sums.squares[j] += e * e;
            sums.largest[j] = e > sums.largest[j] ? e : sums.largest[j];
            sums.low[j] = v < sums.low[j] && v - v == 0 ? v : sums.low[j];
            sums.high[j] = v > sums.high[j] && v - v == 0 ? v : sums.high[j];
        }
    }
    for (int j = 0; i < n; ++i, ++j) {
        sums.squares[j] += d[i] * d[i];
        sums.largest[j] = d[i] > sums.largest[j] ? d[i] : sums.largest[j];
        sums.low[j] = a[i] < sums.low[j] && a[i] - a[i] == 0 ? a[i] : sums.low[j];
        sums.high[j] = a[i] > sums.high[j] && a[i] - a[i] == 0 ? a[i] : sums.high[j];
    }
}

/// Squares of the differences of two rows of values that are taken `scale` times, a power of two.
long double squares_of_row(SlabPair const& pair, std::int64_t y, std::int64_t z, double scale) {
    alignas(64) double a[row_piece], b[row_piece], d[row_piece];
    Box const box = pair.a.box;
    double squares = 0;
    for (std::int64_t x = box.lower.x; x < box.upper.x; x += row_piece) {
        std::int64_t const n = std::min(row_piece, box.upper.x - x);
        load_row(pair.a.type, pair.a.at(x, y, z), a, n);
        load_row(pair.b.type, pair.b.at(x, y, z), b, n);
        map_values(a, n, pair.map_a);
        map_values(b, n, pair.map_b);
        for (std::int64_t i = 0; i < n; ++i) {
            a[i] *= scale;
            b[i] *= scale;
        }
        absolute_differences(a, b, d, n);
        for (std::int64_t i = 0; i < n; ++i) squares += d[i] * d[i];
    }
    return squares / (static_cast<long double>(scale) * scale);
}

RowDifference compare_row(SlabPair const& pair, std::int64_t y, std::int64_t z) {
    alignas(64) double a[row_piece], b[row_piece], d[row_piece];
    Box const box = pair.a.box;
    RowSums sums;
    std::fill_n(sums.low, lanes, infinity);
    std::fill_n(sums.high, lanes, -infinity);
    RowDifference row;
    double const slope = pair.map_a.slope;
    bool const same_map = pair.map_a == pair.map_b; // its intercept takes no part
    bool const wide_a = same_map && is_wide(pair.a.type), wide_b = same_map && is_wide(pair.b.type);
    for (std::int64_t x = box.lower.x; x < box.upper.x; x += row_piece) {
        std::int64_t const n = std::min(row_piece, box.upper.x - x);
        std::byte const *const from_a = pair.a.at(x, y, z), *const from_b = pair.b.at(x, y, z);
        load_row(pair.a.type, from_a, a, n);
        load_row(pair.b.type, from_b, b, n);
        if (wide_a && wide_b)
            with_wide(pair.a.type, from_a, [&](auto const* u) {
                with_wide(pair.b.type, from_b, [&](auto const* v) { exact_differences(u, v, d, n, slope); });
            });
        else if (wide_a)
            with_wide(pair.a.type, from_a, [&](auto const* u) { exact_differences(u, b, d, n, slope); });
        else if (wide_b)
            with_wide(pair.b.type, from_b, [&](auto const* v) { exact_differences(v, a, d, n, slope); });
        map_values(a, n, pair.map_a);
        if (!wide_a && !wide_b) {
            map_values(b, n, pair.map_b);
            absolute_differences(a, b, d, n);
        }
        std::int64_t differing = 0;
#pragma omp simd reduction(+ : differing)
        for (std::int64_t i = 0; i < n; ++i) differing += d[i] > 0 ? 1 : 0;
        if (differing > 0 && row.differing == 0) {
            std::int64_t i = 0;
            while (!(d[i] > 0)) ++i;
            row.first = x + i;
        }
        row.differing += differing;
        accumulate(d, a, n, sums);
    }
    row.low = infinity;
    row.high = -infinity;
    double squares = 0;
    for (int j = 0; j < lanes; ++j) {
        squares += sums.squares[j];
        row.max_abs = std::max(row.max_abs, sums.largest[j]);
        row.low = std::min(row.low, sums.low[j]);
        row.high = std::max(row.high, sums.high[j]);
    }
    row.squares = squares;
    // Squares of differences that double has no room for, or nearly none, are summed once more. Such values are no
    // 64-bit integers.
    if (squares - squares != 0)
        row.squares = squares_of_row(pair, y, z, 0x1p-600);
    else if (row.max_abs > 0 && row.max_abs < 0x1p-450)
        row.squares = squares_of_row(pair, y, z, 0x1p600);
    return row;
}

} // namespace

void difference_rows(SlabPair const& pair, RowDifference* rows, Execution const& execution) {
    Box const box = pair.a.box;
    std::int64_t const ny = box.dims().y;
    for_each_item(execution, threads_for(execution, box.voxels()), ny * box.dims().z,
                  [&](std::int64_t begin, std::int64_t end) {
                      for (std::int64_t r = begin; r < end; ++r)
                          rows[r] = compare_row(pair, box.lower.y + r % ny, box.lower.z + r / ny);
                  });
}

} // namespace VKT_BACKEND

} // namespace vkt
