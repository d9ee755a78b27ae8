// Counting on a GPU without atomics: every thread has counters of a byte of its own, which its warp adds up in time.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/statistics/kernels/count_items.h"

#include <concepts>

namespace vkt::VKT_BACKEND::driver {

inline constexpr unsigned lane_threads = 128, lane_warps = lane_threads / 32;
/// Voxels that a lane may count before its bytes are full, in whole segments.
inline constexpr int lane_segments = 255 / static_cast<int>(count_segment / 32);
/// Of three blocks at least there is room in the shared memory of a multiprocessor.
inline constexpr unsigned most_lane_bytes = 75 << 10;

/// Rows of 32 words, one of each lane: what a thread counts lies in its own bank, whatever the voxels are.
constexpr unsigned lane_rows(std::size_t slots) { return static_cast<unsigned>((slots + 3) / 4); }
constexpr std::size_t lane_bytes(std::size_t slots) {
    return static_cast<std::size_t>(lane_rows(slots)) * (16 + lane_warps * 128);
}

/// Adds the bytes of all lanes of a warp to `totals`, four a row, and clears them. A lane takes whole rows; eight lanes
/// that read together are in different quarters of theirs.
__device__ __forceinline__ void add_lanes(unsigned* warp, unsigned rows, unsigned lane, unsigned* totals) {
    __syncwarp();
    for (unsigned row = lane; row < rows; row += 32) {
        auto* const words = reinterpret_cast<uint4*>(warp + row * 32);
        unsigned even = 0, odd = 0; // two sums each, of 32 bytes at most
        auto const add = [&](unsigned word) {
            even += word & 0x00ff00ffu;
            odd += __byte_perm(word, 0, 0x4341);
        };
#pragma unroll
        for (unsigned i = 0; i < 8; ++i) {
            uint4& quarter = words[(i + lane) % 8];
            uint4 const v = quarter;
            quarter = make_uint4(0, 0, 0, 0);
            add(v.x);
            add(v.y);
            add(v.z);
            add(v.w);
        }
        unsigned* const to = totals + row * 4;
        if ((even & 0xffff) != 0) atomicAdd(to, even & 0xffff);
        if ((odd & 0xffff) != 0) atomicAdd(to + 1, odd & 0xffff);
        if (even >> 16 != 0) atomicAdd(to + 2, even >> 16);
        if (odd >> 16 != 0) atomicAdd(to + 3, odd >> 16);
    }
    __syncwarp();
}

/// What finds a slot may look it up in a table of floats, which is copied into shared memory.
template <class SlotOf>
concept HasTable = requires(SlotOf const& slot_of) {
    { slot_of.table() } -> std::same_as<float const*>;
};

/// Voxels all of the same weight.
template <class T, int N, class SlotOf>
__global__ void __launch_bounds__(lane_threads)
    count_lanes_kernel(DeviceRows in, CountItem const* items, __grid_constant__ SlotOf const slot_of, unsigned slots,
                       unsigned long long weight, unsigned long long* counters) {
    extern __shared__ __align__(16) unsigned lane_memory[];
    CountItem const item = items[blockIdx.x];
    unsigned const rows = lane_rows(slots), words = rows * (4 + lane_threads);
    for (unsigned i = threadIdx.x; i < words; i += lane_threads) lane_memory[i] = 0;
    if constexpr (HasTable<SlotOf>)
        for (unsigned i = threadIdx.x; i < slot_of.table_size(); i += lane_threads)
            reinterpret_cast<float*>(lane_memory + words)[i] = slot_of.table()[i];
    __syncthreads();
    unsigned const warp = threadIdx.x / 32, lane = threadIdx.x % 32;
    unsigned *const totals = lane_memory, *const of_warp = lane_memory + rows * (4 + 32 * warp);
    auto* const mine = reinterpret_cast<unsigned char*>(of_warp + lane);
    float* const table = reinterpret_cast<float*>(lane_memory + words);
    auto const slot_at = [&](T voxel) {
        if constexpr (HasTable<SlotOf>)
            return slot_of(voxel, table);
        else
            return slot_of(voxel);
    };
    auto const count = [&](int slot) {
        auto const s = static_cast<unsigned>(slot);
        ++mine[(s & ~3u) * 32 + (s & 3u)];
    };
    int counted = 0; // segments since the bytes were cleared
    for (std::int64_t s = item.begin + warp; s < item.end; s += lane_warps) {
        CountSegment const segment(in, item, s);
        std::byte const* const from = segment.from;
        int const n = segment.n;
        bool const aligned = reinterpret_cast<std::uintptr_t>(from) % (N * sizeof(T)) == 0;
        auto const load = [&](int i) {
            return load_words<N* static_cast<int>(sizeof(T))>(from + i * static_cast<int>(sizeof(T)), aligned);
        };
        constexpr int step = 32 * N, ahead = 4;
        int i = static_cast<int>(lane) * N;
        for (; i + step * (ahead - 1) + N <= n; i += step * ahead) {
            Words loaded[ahead]; // wait for memory together
#pragma unroll
            for (int k = 0; k < ahead; ++k) loaded[k] = load(i + step * k);
#pragma unroll
            for (int k = 0; k < ahead; ++k) {
                int slots_of_pack[N];
#pragma unroll
                for (int v = 0; v < N; ++v) slots_of_pack[v] = slot_at(voxel_of<T>(loaded[k], v));
#pragma unroll
                for (int v = 0; v < N; ++v) count(slots_of_pack[v]);
            }
        }
        for (; i < n; i += step)
            for (int k = i; k < i + N && k < n; ++k) count(slot_at(reinterpret_cast<T const*>(from)[k]));
        if (++counted == lane_segments) {
            add_lanes(of_warp, rows, lane, totals);
            counted = 0;
        }
    }
    add_lanes(of_warp, rows, lane, totals);
    __syncthreads();
    for (unsigned i = threadIdx.x; i < slots; i += lane_threads)
        if (totals[i] != 0) atomicAdd(counters + item.counters + i, totals[i] * weight);
}

template <class T, int N, class SlotOf>
void launch_count_lanes(DeviceRows const& in, std::vector<CountItem> const& items, SlotOf const& slot_of,
                        unsigned slots, unsigned long long weight, unsigned long long* counters) {
    DeviceList<CountItem> const list(items);
    auto const bytes = static_cast<int>(lane_bytes(slots) + (HasTable<SlotOf> ? slots * sizeof(float) : 0));
    cudaFuncSetAttribute(count_lanes_kernel<T, N, SlotOf>, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
    count_lanes_kernel<T, N, SlotOf>
        <<<static_cast<unsigned>(items.size()), lane_threads, static_cast<unsigned>(bytes)>>>(in, list.get(), slot_of,
                                                                                              slots, weight, counters);
    check_launch("count");
}

} // namespace vkt::VKT_BACKEND::driver
