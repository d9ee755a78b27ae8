// Projections: pixels in vectors, lines one voxel after the other, so that results do not depend on where slabs end.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/project.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/order.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/kernel/shuffle.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Pixels next to one another and the voxels that are added to them, in voxels of the slab.
template <class T> struct Lines {
    T const* first;
    std::int64_t pixel, step, n; ///< strides from pixel to pixel and along the lines, and their length here
    std::size_t at;              ///< the first pixel's place in the image
    std::int64_t pixels;
};

/// Calls f(Lines) for pieces of rows of the image; at most `most` pixels at a time.
template <class T, class F>
void for_each_lines(ProjectionState const& state, ConstView in, std::int64_t most, Execution const& execution,
                    F const& f) {
    std::array<std::int64_t, 3> const stride{1, in.row, in.slice};
    auto const axis = static_cast<std::size_t>(state.axis);
    std::size_t const across = axis == 0 ? 1 : 0, down = axis == 2 ? 1 : 2; // the image's x and y
    Index3 const dims = in.dims();
    auto const a = static_cast<int>(across), d = static_cast<int>(down);
    std::int64_t const pieces = (dims[a] + most - 1) / most;
    for_each_item(threads_for(execution, in.box.voxels()), pieces * dims[d], [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t item = begin; item < end; ++item) {
            std::int64_t const x = item % pieces * most, y = item / pieces;
            auto const at = static_cast<std::size_t>((in.box.lower[d] + y) * state.row() + in.box.lower[a] + x);
            f(Lines<T>{reinterpret_cast<T const*>(in.data) + x * stride[across] + y * stride[down], stride[across],
                       stride[axis], dims[state.axis], at, std::min(most, dims[a] - x)});
        }
    });
}

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

/// The same as for_each_lines(), with pixels side by side: lines along rows are turned, a few at a time.
template <class T, class F>
void for_each_upright(ProjectionState const& state, ConstView in, Execution const& execution, F const& f) {
    if (state.axis != 0) return for_each_lines<T>(state, in, row_piece, execution, f);
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

/// acc[i] = f(acc[i], voxel) for all voxels of the lines. The functor arrives by value, as in the drivers.
template <class A, class T, class F> void fold_lines(Lines<T> const& lines, A* acc, F const f) {
    std::int64_t const pixels = lines.pixels, step = lines.step;
    if (lines.pixel != 1) {
        for (std::int64_t k = 0; k < lines.n; ++k)
            for (std::int64_t i = 0; i < pixels; ++i) acc[i] = f(acc[i], lines.first[k * step + i * lines.pixel]);
        return;
    }
    std::int64_t k = 0;
    for (; k + 4 <= lines.n; k += 4) { // so that results are loaded and stored less often
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
        bool const first = a != a;        // NaN is no value, but what there is at first
        return ((v > a) | first) ? v : a; // no ||: a branch for each of several lines would not be a vector
    }
};
template <class A> struct Smaller {
    template <class T> VKT_HD A operator()(A a, T voxel) const {
        A const v = static_cast<A>(voxel);
        bool const first = a != a;
        return ((v < a) | first) ? v : a;
    }
};
template <class A> struct Plus {
    template <class T> VKT_HD A operator()(A a, T voxel) const { return a + static_cast<A>(voxel); }
};

template <class T> std::int64_t count_nan(Lines<T> const& lines) {
    std::int64_t nan = 0;
    for (std::int64_t k = 0; k < lines.n; ++k) {
        T const* const from = lines.first + k * lines.step;
        std::int32_t here = 0; // of at most row_piece
        if (lines.pixel == 1) {
#pragma omp simd reduction(+ : here)
            for (std::int32_t i = 0; i < static_cast<std::int32_t>(lines.pixels); ++i) {
                auto const v = static_cast<compute_t<T>>(from[i]);
                here += v != v ? 1 : 0;
            }
        } else {
            for (std::int64_t i = 0; i < lines.pixels; ++i) {
                auto const v = static_cast<compute_t<T>>(from[i * lines.pixel]);
                here += v != v ? 1 : 0;
            }
        }
        nan += here;
    }
    return nan;
}

void add_nan(ProjectionState& state, std::int64_t nan) {
    if (nan == 0) return;
#pragma omp atomic
    state.nan += nan;
}

template <class T> void add_extremes(ProjectionState& state, ConstView in, Execution const& execution) {
    using A = std::conditional_t<std::is_same_v<T, Half>, float, T>;
    auto* const image = reinterpret_cast<A*>(state.extremes.data());
    for_each_upright<T>(state, in, execution, [&](Lines<T> const& lines) {
        if (state.kind == Projection::max)
            fold_lines(lines, image + lines.at, Larger<A>{});
        else
            fold_lines(lines, image + lines.at, Smaller<A>{});
        if constexpr (!std::is_integral_v<T>) add_nan(state, count_nan(lines));
    });
}

/// Integers: small ones in 32 bits for as many voxels as fit.
template <class T> void add_whole(ProjectionState& state, ConstView in, Execution const& execution) {
    for_each_upright<T>(state, in, execution, [&](Lines<T> lines) {
        if (!state.wide.empty()) return fold_lines(lines, state.wide.data() + lines.at, Plus<Int128>{});
        std::int64_t* const to = state.whole.data() + lines.at;
        if constexpr (sizeof(T) <= 2) {
            constexpr std::int64_t most = 32768;
            alignas(64) std::int32_t sums[row_piece];
            Lines<T> part = lines;
            for (std::int64_t begin = 0; begin < lines.n; begin += most) {
                part.first = lines.first + begin * lines.step;
                part.n = std::min(most, lines.n - begin);
                std::fill_n(sums, lines.pixels, 0);
                fold_lines(part, sums, Plus<std::int32_t>{});
                for (std::int64_t i = 0; i < lines.pixels; ++i) to[i] += sums[i];
            }
        } else {
            fold_lines(lines, to, Plus<std::int64_t>{});
        }
    });
}

/// Sums of floats; those of float64 with what each addition lost (Neumaier).
template <class T> void add_floats(ProjectionState& state, ConstView in, Execution const& execution) {
    for_each_upright<T>(state, in, execution, [&](Lines<T> const& lines) {
        double* const sum = state.value.data() + lines.at;
        double* const lost = state.extra.empty() ? nullptr : state.extra.data() + lines.at;
        double* const count = state.count.data() + lines.at;
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
    });
}

/// Means and squared deviations (Welford).
template <class T> void add_deviations(ProjectionState& state, ConstView in, Execution const& execution) {
    for_each_upright<T>(state, in, execution, [&](Lines<T> const& lines) {
        double* const mean = state.value.data() + lines.at;
        double* const squares = state.extra.data() + lines.at;
        double* const count = state.count.data() + lines.at;
        std::int64_t nan = 0;
        if constexpr (!std::is_integral_v<T>) add_nan(state, nan = count_nan(lines));
        for (std::int64_t k = 0; k < lines.n; ++k) {
            T const* const from = lines.first + k * lines.step;
            std::int64_t const pixel = lines.pixel;
            if (nan == 0 && pixel == 1) {
#pragma omp simd
                for (std::int64_t i = 0; i < lines.pixels; ++i) {
                    auto const v = static_cast<double>(from[i]);
                    double const n = count[i] + 1, d = v - mean[i], m = mean[i] + d / n;
                    squares[i] += d * (v - m);
                    mean[i] = m;
                    count[i] = n;
                }
                continue;
            }
#pragma omp simd
            for (std::int64_t i = 0; i < lines.pixels; ++i) {
                auto const v = static_cast<double>(from[i * pixel]);
                bool const is = v == v;
                double const n = count[i] + (is ? 1 : 0), d = v - mean[i], m = mean[i] + d / n;
                squares[i] += is ? d * (v - m) : 0;
                mean[i] = is ? m : mean[i];
                count[i] = n;
            }
        }
    });
}

/// The results of a piece of a row of the image.
void finish_pixels(ProjectionState const& state, std::size_t at, std::int64_t n, double* to) {
    auto const length = static_cast<double>(state.dims[state.axis]);
    double const none = std::numeric_limits<double>::quiet_NaN();
    for (std::int64_t i = 0; i < n; ++i) {
        std::size_t const p = at + static_cast<std::size_t>(i);
        if (!state.whole.empty()) {
            to[i] = static_cast<double>(state.whole[p]) / length;
        } else if (!state.wide.empty()) {
            to[i] = static_cast<double>(state.wide[p]) / length;
        } else if (state.kind == Projection::std) {
            to[i] = state.count[p] > 0 ? std::sqrt(state.extra[p] / state.count[p]) : none;
        } else {
            double const sum = state.value[p] + (state.extra.empty() ? 0 : state.extra[p]);
            to[i] = state.kind == Projection::sum ? sum : state.count[p] > 0 ? sum / state.count[p] : none;
        }
    }
}

template <class T> T middle(T a, T b) {
    if constexpr (std::is_integral_v<T>) {
        Int128 const sum = static_cast<Int128>(a) + static_cast<Int128>(b);
        Int128 const low = (sum - (sum & 1)) / 2; // towards the lower one
        return static_cast<T>((sum & 1) != 0 && (low & 1) != 0 ? low + 1 : low);
    } else if constexpr (std::is_same_v<T, double>) {
        return a == b ? a : std::midpoint(a, b);
    } else {
        return static_cast<T>((static_cast<double>(a) + static_cast<double>(b)) / 2);
    }
}

/// The key of infinity, above which all are NaN; the highest of all for integers.
template <class K> K highest_number(DataType type) {
    K key = std::numeric_limits<K>::max();
    if (is_integer(type)) return key;
    VoxelBytes const infinity = voxel_bytes(type, std::numeric_limits<double>::infinity());
    load_keys(type, infinity.data(), &key, 1);
    return key;
}

/// The voxel in the middle of `count` keys; of an even number the mean of the two there, as the type has it.
template <class K> void median_of(DataType type, K* keys, std::size_t count, std::byte* to) {
    K* const upper = keys + count / 2;
    std::nth_element(keys, upper, keys + count);
    K const middle_keys[2] = {count % 2 != 0 ? *upper : *std::max_element(keys, upper), *upper};
    for_each_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) == sizeof(K)) {
            T voxels[2];
            store_keys(type, static_cast<K const*>(middle_keys), reinterpret_cast<std::byte*>(voxels), 2);
            T const result = count % 2 != 0 ? voxels[1] : middle(voxels[0], voxels[1]);
            std::memcpy(to, &result, sizeof result);
        }
    });
}

} // namespace

void project_add(ProjectionState& state, ConstView slab, Execution const& execution) {
    if (slab.box.empty()) return;
    if (slab.box.lower == Index3{}) state.allocate();
    for_each_type(slab.type, [&]<class T>(T) {
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

void project_store(ProjectionState const& state, AnyView out, Losses& losses, Execution const& execution) {
    for_each_segment(execution, out.box, [&](std::int64_t x0, std::int64_t y, std::int64_t z, std::int64_t length) {
        Losses mine;
        for (std::int64_t x = x0; x < x0 + length; x += row_piece) {
            std::int64_t const n = std::min(row_piece, x0 + length - x);
            auto const at = static_cast<std::size_t>(y * state.row() + x);
            std::byte* const to = out.at(x, y, z);
            bool const sums = state.kind == Projection::sum;
            if (state.kind == Projection::max || state.kind == Projection::min) {
                if (out.type == DataType::float16)
                    mine += store_row(out.type, reinterpret_cast<float const*>(state.extremes.data()) + at, to, n);
                else
                    std::memcpy(to, state.extremes.data() + at * size_of(out.type),
                                static_cast<std::size_t>(n) * size_of(out.type));
            } else if (sums && !state.wide.empty()) {
                mine += store_row(out.type, state.wide.data() + at, to, n);
            } else if (sums && !state.whole.empty()) { // as int64 it is what uint64 holds as well
                std::memcpy(to, state.whole.data() + at, static_cast<std::size_t>(n) * 8);
            } else {
                alignas(64) double values[row_piece];
                finish_pixels(state, at, n, values);
                mine += store_row(out.type, static_cast<double const*>(values), to, n);
            }
        }
        driver::add(losses, mine);
    });
}

void median_lines(ConstView in, AnyView out, int axis, std::int64_t& nan, Execution const& execution) {
    ProjectionState image; // for its places
    image.axis = axis;
    image.dims = in.dims();
    ConstView const from = in.moved_to({});
    VoxelBytes const none = voxel_bytes(out.type, std::numeric_limits<double>::quiet_NaN());
    with_order_key(in.type, [&]<class K>(K) {
        constexpr std::int64_t together = 32; // lines next to one another, which share cache lines
        K const highest = highest_number<K>(in.type);
        for_each_lines<K>(image, from, together, execution, [&](Lines<K> const& lines) {
            auto const n = static_cast<std::size_t>(lines.n);
            std::vector<K> all(static_cast<std::size_t>(lines.pixels) * n);
            for (std::size_t k = 0; k < n; ++k)
                for (std::int64_t i = 0; i < lines.pixels; ++i)
                    all[static_cast<std::size_t>(i) * n + k] =
                        lines.first[static_cast<std::int64_t>(k) * lines.step + i * lines.pixel];
            load_keys(in.type, reinterpret_cast<std::byte const*>(all.data()), all.data(),
                      static_cast<std::int64_t>(all.size()));
            std::int64_t missing = 0;
            for (std::int64_t i = 0; i < lines.pixels; ++i) {
                K* const line = all.data() + static_cast<std::size_t>(i) * n;
                auto const numbers = static_cast<std::size_t>(
                    std::remove_if(line, line + n, [&](K key) { return key > highest; }) - line);
                missing += static_cast<std::int64_t>(n - numbers);
                auto const place = static_cast<std::int64_t>(lines.at) + i;
                std::byte* const pixel = out.at(out.box.lower.x + place % image.row(),
                                                out.box.lower.y + place / image.row(), out.box.lower.z);
                if (numbers > 0)
                    median_of(in.type, line, numbers, pixel);
                else
                    std::memcpy(pixel, none.data(), sizeof(K));
            }
            if (missing == 0) return;
#pragma omp atomic
            nan += missing;
        });
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
