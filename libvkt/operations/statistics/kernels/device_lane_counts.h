// Counting on a GPU without atomics: every thread has counters of a byte of its own, which its warp adds up in time.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/statistics/kernels/count_items.h"

#include <concepts>

namespace vkt::VKT_BACKEND::driver {

inline constexpr unsigned lane_threads = 128, lane_warps = lane_threads / 32;
inline constexpr int lane_limit = 255; ///< voxels that a lane may count before its bytes are full
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

/// What finds a slot may have slots of its own for lanes, most of which it finds quickly, and a table of floats to look
/// up the others, which is copied into shared memory.
template <class SlotOf>
concept IsQuick = requires(SlotOf const& slot_of) {
    { slot_of.lane_slots() } -> std::same_as<unsigned>;
    { slot_of.table() } -> std::same_as<float const*>;
};
template <class SlotOf> constexpr std::size_t slots_of_lanes(std::size_t slots) {
    return IsQuick<SlotOf> ? slots + 1 : slots;
}

/// Voxels all of the same weight. Short: rows may be of half a warp's voxels or less.
template <class T, int N, bool Short, class SlotOf>
__global__ void __launch_bounds__(lane_threads)
    count_lanes_kernel(DeviceRows in, CountItem const* items, __grid_constant__ SlotOf const slot_of, unsigned slots,
                       unsigned long long weight, unsigned long long* counters) {
    extern __shared__ __align__(16) unsigned lane_memory[];
    CountItem const item = items[blockIdx.x];
    if constexpr (IsQuick<SlotOf>) slots = slot_of.lane_slots();
    unsigned const rows = lane_rows(slots), words = rows * (4 + lane_threads);
    for (unsigned i = threadIdx.x; i < words; i += lane_threads) lane_memory[i] = 0;
    if constexpr (IsQuick<SlotOf>)
        for (unsigned i = threadIdx.x; i < slot_of.table_size(); i += lane_threads)
            reinterpret_cast<float*>(lane_memory + words)[i] = slot_of.table()[i];
    __syncthreads();
    unsigned const warp = threadIdx.x / 32, lane = threadIdx.x % 32;
    unsigned *const totals = lane_memory, *const of_warp = lane_memory + rows * (4 + 32 * warp);
    auto* const mine = reinterpret_cast<unsigned char*>(of_warp + lane);
    float* const table = reinterpret_cast<float*>(lane_memory + words);
    auto const slot_at = [&](T voxel) {
        if constexpr (IsQuick<SlotOf>)
            return slot_of.closely(voxel, table);
        else
            return slot_of(voxel);
    };
    auto const count = [&](int slot) {
        auto const s = static_cast<unsigned>(slot);
        ++mine[s * 32 - (s & 3u) * 31]; // byte s % 4 of row s / 4
    };
    auto const count_pack = [&](Words const& words) {
        int slots_of_pack[N];
        bool found = false;
        if constexpr (IsQuick<SlotOf>) {
            T voxels[N];
#pragma unroll
            for (int v = 0; v < N; ++v) voxels[v] = voxel_of<T>(words, v);
            found = slot_of.quickly(voxels, slots_of_pack);
        }
        if (!found) {
#pragma unroll
            for (int v = 0; v < N; ++v) slots_of_pack[v] = slot_at(voxel_of<T>(words, v));
        }
#pragma unroll
        for (int v = 0; v < N; ++v) count(slots_of_pack[v]);
    };
    auto const load = [](std::byte const* from, int i) {
        bool const aligned = reinterpret_cast<std::uintptr_t>(from) % (N * sizeof(T)) == 0;
        return load_words<N* static_cast<int>(sizeof(T))>(from + i * static_cast<int>(sizeof(T)), aligned);
    };
    int counted = 0; // voxels of a lane since the bytes were cleared
    auto const make_room = [&](int voxels) {
        if (counted + voxels > lane_limit) {
            add_lanes(of_warp, rows, lane, totals);
            counted = 0;
        }
        counted += voxels;
    };
    constexpr int ahead = 4; // loads that wait for memory together
    if (Short && item.nx <= 16 * N) {
        // Rows of fewer packs than lanes: a warp has several at once.
        int const log = 32 - __clz(static_cast<int>((item.nx + N - 1) / N) - 1), at_once = 32 >> log,
                  i = static_cast<int>(lane & ((1U << log) - 1)) * N, step = static_cast<int>(lane_warps) * at_once;
        for (std::int64_t s = item.begin + warp * at_once; s < item.end; s += ahead * step) {
            make_room(ahead * N);
            Words loaded[ahead];
            std::byte const* from[ahead];
            int left[ahead]; // voxels of the row from this lane's first on
#pragma unroll
            for (int k = 0; k < ahead; ++k) {
                std::int64_t const row = s + k * step + (lane >> log);
                CountSegment const segment(in, item, row < item.end ? row : s);
                from[k] = segment.from;
                left[k] = row < item.end ? segment.n - i : 0;
                if (left[k] >= N) loaded[k] = load(from[k], i);
            }
#pragma unroll
            for (int k = 0; k < ahead; ++k) {
                if (left[k] >= N)
                    count_pack(loaded[k]);
                else
                    for (int v = 0; v < left[k]; ++v) count(slot_at(reinterpret_cast<T const*>(from[k])[i + v]));
            }
        }
    } else {
        constexpr int step = 32 * N;
        int const longest = static_cast<int>(item.nx < count_segment ? item.nx : count_segment),
                  of_lane = (longest + step - 1) / step * N;
        for (std::int64_t s = item.begin + warp; s < item.end; s += lane_warps) {
            make_room(of_lane);
            CountSegment const segment(in, item, s);
            std::byte const* const from = segment.from;
            int const n = segment.n;
            int i = static_cast<int>(lane) * N;
            for (; i + step * (ahead - 1) + N <= n; i += step * ahead) {
                Words loaded[ahead];
#pragma unroll
                for (int k = 0; k < ahead; ++k) loaded[k] = load(from, i + step * k);
#pragma unroll
                for (int k = 0; k < ahead; ++k) count_pack(loaded[k]);
            }
            for (; i < n; i += step)
                for (int k = i; k < i + N && k < n; ++k) count(slot_at(reinterpret_cast<T const*>(from)[k]));
        }
    }
    add_lanes(of_warp, rows, lane, totals);
    __syncthreads();
    for (unsigned i = threadIdx.x; i < slots; i += lane_threads) {
        unsigned slot = i;
        if constexpr (IsQuick<SlotOf>) slot = slot_of.slot_of_lane(i);
        if (totals[i] != 0) atomicAdd(counters + item.counters + slot, totals[i] * weight);
    }
}

template <class T, int N, bool Short, class SlotOf>
void launch_count_lanes(DeviceRows const& in, std::vector<CountItem> const& items, SlotOf const& slot_of,
                        unsigned slots, unsigned long long weight, unsigned long long* counters) {
    DeviceList<CountItem> const list(items);
    auto const bytes =
        static_cast<int>(lane_bytes(slots_of_lanes<SlotOf>(slots)) + (IsQuick<SlotOf> ? slots * sizeof(float) : 0));
    cudaFuncSetAttribute(count_lanes_kernel<T, N, Short, SlotOf>, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes);
    count_lanes_kernel<T, N, Short, SlotOf>
        <<<static_cast<unsigned>(items.size()), lane_threads, static_cast<unsigned>(bytes)>>>(in, list.get(), slot_of,
                                                                                              slots, weight, counters);
    check_launch("count");
}

} // namespace vkt::VKT_BACKEND::driver
