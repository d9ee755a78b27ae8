// Reductions on GPUs: one partial result a block, merged in order on the host.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_packs.h"

#include <algorithm>
#include <type_traits>
#include <vector>

namespace vkt::VKT_BACKEND {

namespace driver {

inline constexpr std::int64_t segment_voxels = 16384;

/// One partial result a block: every gridDim.x-th segment of the rows, in packs of N voxels; merged in order on the
/// host. How voxels meet depends on nothing but the dims.
template <class C, int N, class R>
__global__ void __launch_bounds__(block_threads)
    reduce_any(DeviceRows in, Index3 dims, std::int64_t segments, R zero, R* parts) {
    constexpr int K = packs_at_once<C, N, 1>();
    R mine = zero;
    for (std::int64_t item = blockIdx.x; item < dims.y * dims.z * segments; item += gridDim.x) {
        std::int64_t const row = quotient_of(item, segments), begin = (item - row * segments) * segment_voxels;
        std::int64_t const z = quotient_of(row, dims.y), y = row - z * dims.y;
        int const n = static_cast<int>(dims.x - begin < segment_voxels ? dims.x - begin : segment_voxels);
        std::byte const* const from = in.at(begin, y, z);
        bool const aligned = reinterpret_cast<std::uintptr_t>(from) % static_cast<unsigned>(N * in.size) == 0;
        for (int x = static_cast<int>(threadIdx.x) * N; x < n; x += K * block_threads * N) {
            int const last = n / N * N - N;
            int at[K];
#pragma unroll
            for (int k = 0; k < K; ++k) at[k] = min(x + k * block_threads * N, last);
            C values[K][N];
            if (last >= 0) load_packs(in.type, aligned, from, at, values);
#pragma unroll
            for (int k = 0; k < K; ++k) {
                int const first = x + k * block_threads * N;
                if (first <= last) {
#pragma unroll
                    for (int i = 0; i < N; ++i) mine.add(values[k][i]);
                } else {
                    for (int i = first; i < n; ++i) mine.add(load_value<C>(in.type, from + i * in.size));
                }
            }
        }
    }
    extern __shared__ __align__(16) unsigned char memory[];
    R* const all = reinterpret_cast<R*>(memory);
    all[threadIdx.x] = mine;
    for (unsigned half = block_threads / 2; half > 0; half /= 2) {
        __syncthreads();
        if (threadIdx.x < half) all[threadIdx.x].merge(all[threadIdx.x + half]);
    }
    if (threadIdx.x == 0) parts[blockIdx.x] = all[0];
}

template <class C, int N, class R>
void launch_reduce(DeviceRows in, Index3 dims, unsigned blocks, std::int64_t segments, R const& zero, R* parts) {
    reduce_any<C, N><<<blocks, block_threads, block_threads * sizeof(R)>>>(in, dims, segments, zero, parts);
    check_launch("reduce");
}

} // namespace driver

template <class C, class R> R reduce(Execution const&, ConstView in, R const& zero) {
    static_assert(std::is_trivially_copyable_v<R>);
    R result = zero;
    if (in.box.empty()) return result;
    Index3 const dims = in.contiguous() ? Index3{in.box.voxels(), 1, 1} : in.dims();
    std::int64_t const segments = (dims.x + driver::segment_voxels - 1) / driver::segment_voxels;
    auto const blocks = static_cast<unsigned>(std::min<std::int64_t>(dims.y * dims.z * segments, 2048));
    driver::DeviceScratch const scratch(blocks * sizeof(R));
    R* const parts = reinterpret_cast<R*>(scratch.get());
    driver::DeviceRows const rows = driver::device_rows(in, in.box);
    switch (rows.size) {
    case 1:
        driver::launch_reduce<C, 16>(rows, dims, blocks, segments, zero, parts);
        break;
    case 2:
        driver::launch_reduce<C, 8>(rows, dims, blocks, segments, zero, parts);
        break;
    case 4:
        driver::launch_reduce<C, 4>(rows, dims, blocks, segments, zero, parts);
        break;
    default:
        driver::launch_reduce<C, 2>(rows, dims, blocks, segments, zero, parts);
    }
    std::vector<R> host(blocks, zero);
    copy_to_host(host.data(), parts, blocks * sizeof(R));
    for (R const& part : host) result.merge(part);
    return result;
}

} // namespace vkt::VKT_BACKEND
