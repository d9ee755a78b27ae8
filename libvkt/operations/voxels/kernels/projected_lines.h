// The lines of voxels that become the pixels of a projection, several next to one another. For kernel sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/integer_sums.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/operations/voxels/kernels/project.h"

#include <algorithm>
#include <array>

namespace vkt::VKT_BACKEND {

// Nothing here may have external linkage: the same function compiled for another instruction set must not replace it.
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
    Index3 dims = in.dims();
    auto const a = static_cast<int>(across), d = static_cast<int>(down);
    if (axis == 2 && in.row == dims.x && state.row() == dims.x) { // slices without gaps are rows
        dims = {dims.x * dims.y, 1, dims.z};
        std::int64_t const shares = std::int64_t{4} * std::max(1, execution.threads);
        most = std::clamp<std::int64_t>((dims.x / shares + 63) / 64 * 64, 64, most);
    }
    std::int64_t const pieces = (dims[a] + most - 1) / most;
    for_each_item(execution, threads_for(execution, in.box.voxels()), pieces * dims[d],
                  [&](std::int64_t begin, std::int64_t end) {
                      for (std::int64_t item = begin; item < end; ++item) {
                          std::int64_t const x = item % pieces * most, y = item / pieces;
                          auto const at =
                              static_cast<std::size_t>((in.box.lower[d] + y) * state.row() + in.box.lower[a] + x);
                          f(Lines<T>{reinterpret_cast<T const*>(in.data) + x * stride[across] + y * stride[down],
                                     stride[across], stride[axis], dims[state.axis], at, std::min(most, dims[a] - x)});
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

inline void add_nan(ProjectionState& state, std::int64_t nan) {
    if (nan == 0) return;
#pragma omp atomic
    state.nan += nan;
}

constexpr int row_lanes = 16;

/// Calls f(lines) for parts of the lines of at most `most` voxels, in order.
template <class T, class F> void in_parts(Lines<T> const& lines, std::int64_t most, F const& f) {
    Lines<T> part = lines;
    for (std::int64_t k = 0; k < lines.n; k += most) {
        part.first = lines.first + k * lines.step;
        part.n = std::min(most, lines.n - k);
        f(part);
    }
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

/// As many values as fit into a register.
template <class A> struct Vector {
    typedef A type __attribute__((vector_size(register_bytes)));
    typedef A unaligned __attribute__((vector_size(register_bytes), aligned(sizeof(A)), may_alias));
    static constexpr std::int64_t lanes = static_cast<std::int64_t>(register_bytes / sizeof(A));
    static type load(A const* from) { return *reinterpret_cast<unaligned const*>(from); }
};

} // namespace

} // namespace vkt::VKT_BACKEND
