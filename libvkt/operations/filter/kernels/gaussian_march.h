// Gaussian of small radius, GPU: blocks march along y, then along z, with what a column sees in registers.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/gaussian.h"

#include <cuda_runtime.h>

namespace vkt::VKT_BACKEND::gaussian {

__device__ __forceinline__ float blend(float share, float pair, float sum) { return madd(share, pair - sum, sum); }
__device__ __forceinline__ double blend(double share, double pair, double sum) { return madd(share, pair - sum, sum); }

/// Where slices lie between the kernels: a ring of padded planes, filled by absolute slice.
template <class C> struct Middle {
    C* data;
    std::int64_t pitch, plane, slots;
    __device__ C* slice(std::int64_t z) const { return data + ((z % slots + slots) % slots) * plane; }
};

template <class C> struct Surroundings {
    Index3 dims;
    Boundary boundary;
    C scaled_border;
    std::int64_t first_y, end_y; ///< rows of the input, some of them perhaps wrapped around

    /// The row of the input that stands for row y, which the border value does if that is not one of them.
    __device__ std::int64_t row_of(std::int64_t y) const { return holds(y) ? y : fold(y, dims.y, boundary); }
    __device__ bool holds(std::int64_t y) const { return y >= first_y && y < end_y; }
};

constexpr int march_width = 128;  ///< columns of a block, one a thread
constexpr int march_group = 16;   ///< voxels of a column, or of a row, that a thread filters at once
constexpr int most_marched = 16;  ///< radius
constexpr int march_chunk = 256;  ///< rows that a block goes along
constexpr int march_slices = 128; ///< and slices

/// Shares of the pairs, as parameters of a launch.
struct MarchTaps {
    int radius;
    float shares[most_marched + 1];
};

/// Nested averages (see GaussianTaps) of neighbours, twice as large: of voxel s those around w[R + s].
template <int R>
__device__ __forceinline__ void average_window(float const (&w)[march_group + 2 * R], MarchTaps const& taps,
                                               float (&sum)[march_group]) {
    int const r = taps.radius;
    if (r == 0) {
#pragma unroll
        for (int s = 0; s < march_group; ++s) sum[s] = w[R + s] + w[R + s];
        return;
    }
#pragma unroll
    for (int k = R; k >= 0; --k) {
        if (k > r) continue;
        if (k == r) {
#pragma unroll
            for (int s = 0; s < march_group; ++s) sum[s] = w[R + s - k] + w[R + s + k];
        } else {
#pragma unroll
            for (int s = 0; s < march_group; ++s) sum[s] = blend(taps.shares[k], w[R + s - k] + w[R + s + k], sum[s]);
        }
    }
}

/// One slice along x and y into the middle. In each step a block takes in some rows, filters them along x, a thread a
/// piece of a row, and hands them over to the threads whose columns they are.
/// `Bordered`: some voxels are the border value.
template <class T, int R, bool Bordered>
__global__ void __launch_bounds__(march_width, R == 8 ? 4 : 3)
    march_xy(View<T const> in, Box box, std::int64_t first_slice, unsigned across,
             __grid_constant__ MarchTaps const x_taps, __grid_constant__ MarchTaps const y_taps,
             Surroundings<float> rule, Middle<float> middle) {
    constexpr int group = march_group, width = march_width, wide = width + 2 * R;
    constexpr int in_pitch = (wide + 30) / 32 * 32 + 1, pitch = width + 1; // rows of threads meet different banks
    constexpr int pieces = (wide + 31) / 32, warps = width / 32;
    __shared__ float loaded[group * in_pitch];
    __shared__ float lines[group * pitch];
    int const thread = static_cast<int>(threadIdx.x), lane = thread % 32, warp = thread / 32;
    std::int64_t const x0 = box.lower.x + static_cast<std::int64_t>(blockIdx.x % across) * width,
                       y0 = box.lower.y + static_cast<std::int64_t>(blockIdx.x / across) * march_chunk,
                       z = first_slice + blockIdx.y;
    std::int64_t const end = min(y0 + march_chunk, box.upper.y);
    // Columns and rows beyond the output's own halo are never used; the nearest that is keeps reads inside.
    constexpr int outside = -(1 << 30);
    int column[pieces];
#pragma unroll
    for (int c = 0; c < pieces; ++c) {
        std::int64_t const x =
            max(box.lower.x - x_taps.radius, min(x0 - R + lane + 32 * c, box.upper.x - 1 + x_taps.radius));
        std::int64_t const from = fold(x, rule.dims.x, rule.boundary);
        column[c] = from < 0 ? outside : static_cast<int>(from - box.lower.x);
    }
    float window[group + 2 * R];
    float* to = middle.slice(z) + (y0 - box.lower.y) * middle.pitch + (x0 - box.lower.x) + thread;
    bool const stored = x0 + thread < box.upper.x;
    int const down = static_cast<int>(middle.pitch);
    // Voxels of the rows that come next: they are on their way while rows are filtered.
    T values[group / warps][pieces];
    bool there[group / warps];
    auto const load = [&](std::int64_t y) {
#pragma unroll
        for (int j = 0; j < group / warps; ++j) {
            std::int64_t const row = rule.row_of(
                max(box.lower.y - y_taps.radius, min(y + R + warp + j * warps, box.upper.y - 1 + y_taps.radius)));
            there[j] = !Bordered || rule.holds(row);
            T const* const from = &in(box.lower.x, there[j] ? row : box.lower.y, z);
#pragma unroll
            for (int c = 0; c < pieces; ++c) values[j][c] = from[Bordered && column[c] == outside ? 0 : column[c]];
        }
    };
    load(y0 - 2 * R);
    for (std::int64_t y = y0 - 2 * R; y < end; y += group) { // of the first row that is made
#pragma unroll
        for (int j = 0; j < group / warps; ++j)
#pragma unroll
            for (int c = 0; c < pieces; ++c)
                if (lane + 32 * c < wide)
                    loaded[(warp + j * warps) * in_pitch + lane + 32 * c] =
                        Bordered && (!there[j] || column[c] == outside)
                            ? rule.scaled_border
                            : float(gaussian_scale) * static_cast<float>(values[j][c]);
        __syncthreads();
        if (y + group < end) load(y + group);
        {
            int const row = thread % group, first = thread / group * group;
            float around[group + 2 * R], sum[group];
#pragma unroll
            for (int i = 0; i < group + 2 * R; ++i) around[i] = loaded[row * in_pitch + first + i];
            average_window<R>(around, x_taps, sum);
#pragma unroll
            for (int s = 0; s < group; ++s) lines[row * pitch + first + s] = 0.5f * sum[s];
        }
        __syncthreads();
#pragma unroll
        for (int i = 0; i < 2 * R; ++i) window[i] = window[i + group];
#pragma unroll
        for (int s = 0; s < group; ++s) window[2 * R + s] = lines[s * pitch + thread];
        if (y < y0) continue; // rows above the first one
        float sum[group];
        average_window<R>(window, y_taps, sum);
        if (stored && y + group <= end) {
#pragma unroll
            for (int s = 0; s < group; ++s) to[s * down] = 0.5f * sum[s];
        } else if (stored) {
#pragma unroll
            for (int s = 0; s < group; ++s)
                if (y + s < end) to[s * down] = 0.5f * sum[s];
        }
        to += group * middle.pitch;
    }
}

/// Along z, out of the middle into the output.
template <class T, int R>
__global__ void __launch_bounds__(march_width)
    march_z(Middle<float> middle, Box box, View<T> out, unsigned across, __grid_constant__ MarchTaps const taps,
            Surroundings<float> rule) {
    constexpr int group = march_group;
    __shared__ long long offsets[march_slices + 2 * R]; // of the slices that the block reads; -1 for the border value
    std::int64_t const z0 = box.lower.z + static_cast<std::int64_t>(blockIdx.y) * march_slices;
    for (int i = static_cast<int>(threadIdx.x); i < march_slices + 2 * R; i += march_width) {
        // Slices beyond the output's halo belong to outputs that are not stored; the nearest stands for them.
        std::int64_t const z = max(box.lower.z - taps.radius, min(z0 - R + i, box.upper.z - 1 + taps.radius));
        std::int64_t const from = rule.boundary == Boundary::wrap ? z : fold(z, rule.dims.z, rule.boundary);
        bool const outside = from < 0 && rule.boundary != Boundary::wrap;
        offsets[i] = outside ? -1 : middle.slice(from) - middle.data;
    }
    __syncthreads();
    std::int64_t const x = static_cast<std::int64_t>(blockIdx.x % across) * march_width + threadIdx.x,
                       y = blockIdx.x / across;
    if (x >= box.upper.x - box.lower.x) return;
    float const* const column = middle.data + y * middle.pitch + x;
    auto const at = [&](int i) { return offsets[i] < 0 ? rule.scaled_border : column[offsets[i]]; };
    T* to = &out(box.lower.x + x, box.lower.y + y, z0);
    int const count = static_cast<int>(min(static_cast<std::int64_t>(march_slices), box.upper.z - z0));
    float window[group + 2 * R];
#pragma unroll
    for (int i = 0; i < 2 * R; ++i) window[i + group] = at(i);
    for (int made = 0; made < count; made += group) {
#pragma unroll
        for (int i = 0; i < 2 * R; ++i) window[i] = window[i + group];
#pragma unroll
        for (int s = 0; s < group; ++s) window[2 * R + s] = at(made + 2 * R + s);
        float sum[group];
        average_window<R>(window, taps, sum);
#pragma unroll
        for (int s = 0; s < group; ++s, to += out.slice)
            if (made + s < count) *to = round_to<T>(2.0f * sum[s]);
    }
}

} // namespace vkt::VKT_BACKEND::gaussian
