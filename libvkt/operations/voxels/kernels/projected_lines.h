// The lines of voxels that become the pixels of a projection, several next to one another. For kernel sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
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

/// As many values as fit into a register.
template <class A> struct Vector {
    typedef A type __attribute__((vector_size(register_bytes)));
    typedef A unaligned __attribute__((vector_size(register_bytes), aligned(sizeof(A)), may_alias));
    static constexpr std::int64_t lanes = static_cast<std::int64_t>(register_bytes / sizeof(A));
    static type load(A const* from) { return *reinterpret_cast<unaligned const*>(from); }
};

} // namespace

} // namespace vkt::VKT_BACKEND
