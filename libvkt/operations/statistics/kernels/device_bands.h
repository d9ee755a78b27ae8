// Bands of rows on a GPU: 16 threads each, one for each of the lanes in which CPUs sum, and voxels on their way there.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/operations/statistics/kernels/statistics_bands.h"

namespace vkt::VKT_BACKEND::bands {

inline constexpr int lanes = statistics_lanes;
inline constexpr int block = 128;

/// A slab cut into bands, as BandStatistics has it.
struct Bands {
    std::int64_t length, rows, pitch, slice; ///< voxels; rows of a band; voxels between rows and slices
    std::int64_t ny, per_slice, count;
};

template <class T> struct DeviceBand {
    T const* voxels;
    std::int64_t length, rows, pitch;
};

template <class T> __device__ DeviceBand<T> band_at(T const* in, Bands const& bands, std::int64_t b) {
    std::int64_t const z = driver::quotient_of(b, bands.per_slice), y = (b - z * bands.per_slice) * bands.rows;
    return {in + y * bands.pitch + z * bands.slice, bands.length, min(bands.rows, bands.ny - y), bands.pitch};
}
/// Rows that end where a lane begins fill the lanes the same way when they are one long row.
template <class T> __device__ DeviceBand<T> joined(DeviceBand<T> band) {
    if (band.length == band.pitch && band.length % lanes == 0) band = {band.voxels, band.length * band.rows, 1, 0};
    return band;
}

struct Lane {
    unsigned mask; ///< of the band's threads
    int index;
    std::int64_t band;
};
__device__ inline Lane this_lane() {
    unsigned const half = threadIdx.x % 32 / lanes;
    return {0xffffu << (lanes * half), static_cast<int>(threadIdx.x % lanes),
            (static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x) / lanes};
}
/// The band's lanes added as CPUs do, in the first of them.
__device__ inline double folded(double v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) v += __shfl_down_sync(lane.mask, v, half, lanes);
    return v;
}
template <class V> __device__ V added(V v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) v += __shfl_down_sync(lane.mask, v, half, lanes);
    return v;
}
template <class V> __device__ V least(V v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) {
        V const other = __shfl_down_sync(lane.mask, v, half, lanes);
        v = other < v ? other : v;
    }
    return v;
}
template <class V> __device__ V most(V v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) {
        V const other = __shfl_down_sync(lane.mask, v, half, lanes);
        v = v < other ? other : v;
    }
    return v;
}

template <class T> __device__ bool is_finite(T v) { return v - v == T(0); }

/// What a band has on its way from global memory: pieces of 1 KiB, two of which are being copied while one is read.
/// 64 bytes more, so that the two bands of a warp are read from different banks.
struct Ring {
    static constexpr int piece = 1024, pieces = 3, bytes = pieces * piece + 64;
    std::byte* memory;

    __device__ __forceinline__ static Ring of_band() {
        __shared__ alignas(16) std::byte rings[block / lanes][bytes];
        return {rings[threadIdx.x / lanes]};
    }
    __device__ __forceinline__ std::byte* slot(unsigned number) const { return memory + number % pieces * piece; }
    /// Every call is one group of copies, also of nothing.
    __device__ __forceinline__ void copy(std::byte const* from, unsigned number, unsigned count, int lane) const {
        if (number < count) {
            auto const to = static_cast<unsigned>(__cvta_generic_to_shared(slot(number))) + 16 * lane;
#pragma unroll
            for (int k = 0; k < piece; k += 16 * lanes)
                asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(to + k),
                             "l"(from + static_cast<std::int64_t>(number) * piece + 16 * lane + k));
        }
        asm volatile("cp.async.commit_group;" ::: "memory");
    }
    /// All but the last group of copies is there.
    __device__ __forceinline__ static void wait(unsigned mask) {
        asm volatile("cp.async.wait_group 1;" ::: "memory");
        __syncwarp(mask);
    }
};

/// Calls f(values) for the voxels of this lane, some at once: those of whole groups of 16 first, then tail(value) for
/// the others.
template <class T, class F, class Tail>
__device__ void for_lane(DeviceBand<T> const& band, Lane const& lane, F const& f, Tail const& tail) {
    constexpr int together = 8, in_piece = Ring::piece / static_cast<int>(sizeof(T)), each = in_piece / lanes;
    std::int64_t const whole = band.length / lanes * lanes;
    Ring const ring = Ring::of_band();
    for (std::int64_t r = 0; r < band.rows; ++r) {
        T const* const row = band.voxels + r * band.pitch;
        std::int64_t i = lane.index;
        if (reinterpret_cast<std::uintptr_t>(row) % 16 == 0) {
            auto const* const from = reinterpret_cast<std::byte const*>(row);
            auto const count = static_cast<unsigned>(whole / in_piece);
            __syncwarp(lane.mask); // the ring has been read
            ring.copy(from, 0, count, lane.index);
            ring.copy(from, 1, count, lane.index);
            for (unsigned number = 0; number < count; ++number) {
                Ring::wait(lane.mask);
                ring.copy(from, number + 2, count, lane.index);
                T const* const piece = reinterpret_cast<T const*>(ring.slot(number)) + lane.index;
#pragma unroll 2
                for (int k = 0; k < each; k += together) {
                    T v[together];
#pragma unroll
                    for (int j = 0; j < together; ++j) v[j] = piece[(k + j) * lanes];
                    f(v);
                }
            }
            i += static_cast<std::int64_t>(count) * in_piece;
        }
        for (; i + (together - 1) * lanes < whole; i += together * lanes) {
            T v[together];
#pragma unroll
            for (int k = 0; k < together; ++k) v[k] = row[i + k * lanes];
            f(v);
        }
        for (; i < whole; i += lanes) {
            T const v[1] = {row[i]};
            f(v);
        }
        if (i < band.length) tail(row[i]);
    }
}
/// The same one by one.
template <class T, class F> __device__ void for_each_of_lane(DeviceBand<T> const& band, Lane const& lane, F const& f) {
    for_lane(
        band, lane,
        [&]<int N>(T const(&v)[N]) {
#pragma unroll
            for (int k = 0; k < N; ++k) f(v[k]);
        },
        f);
}

} // namespace vkt::VKT_BACKEND::bands
