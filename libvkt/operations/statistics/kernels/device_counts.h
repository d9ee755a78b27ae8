// Counting on a GPU: each block of threads counts a part of a brick in shared memory, and adds that up once.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/statistics/kernels/device_lane_counts.h"

#include <bit>

namespace vkt::VKT_BACKEND::driver {

inline constexpr int count_ahead = 4;
inline constexpr unsigned most_shared_counters = 10240;       ///< of 32 bits
inline constexpr unsigned most_packed_counters = 65536 + 256; ///< of 16 bits, which a block counts no more voxels than
inline constexpr unsigned packed_threads = 1024;              ///< of such a block: no other has room beside it

/// Equal voxels that follow one another are added at once.
template <class Add> struct CountRun {
    Add const& add;
    int slot = -1;
    std::uint64_t sum = 0;

    __device__ __forceinline__ void take(int next, std::uint64_t weight) {
        if (next != slot) {
            flush();
            slot = next;
        }
        sum += weight;
    }
    __device__ __forceinline__ void flush() {
        if (sum != 0) add(slot, sum);
        sum = 0;
    }
};

template <class T> __device__ __forceinline__ bool differ(T a, T b) {
    if constexpr (std::is_same_v<T, Half>)
        return static_cast<float>(a) != static_cast<float>(b);
    else
        return a != b;
}

/// What finds a slot says for which voxels that takes few steps: `template <class T> using is_cheap`.
template <class SlotOf, class T>
concept IsCheap = requires {
    requires SlotOf::template is_cheap<T>::value;
};

/// `slots` counters a brick, of which so many copies lie in shared memory, those of a slot side by side: with 32 of
/// them no two lanes meet in a bank, whatever the voxels are. None if they have no room there, one of 16 bits each if
/// Packed. `plain`: all weights are 1.
template <class T, int N, bool Packed, class SlotOf>
__global__ void __launch_bounds__(Packed ? packed_threads : block_threads, Packed ? 1 : 5)
    count_kernel(DeviceRows in, CountItem const* items, CountGrid grid, __grid_constant__ SlotOf const slot_of,
                 unsigned slots, unsigned copies, bool plain, unsigned long long* counters) {
    extern __shared__ unsigned shared[];
    CountItem const item = items[blockIdx.x];
    unsigned const words = Packed ? (slots + 1) / 2 : slots * copies;
    for (unsigned i = threadIdx.x; i < words; i += blockDim.x) shared[i] = 0;
    __syncthreads();
    unsigned const warp = threadIdx.x / 32, lane = threadIdx.x % 32;
    unsigned* const mine = Packed ? shared : copies > 0 ? shared + lane % copies : nullptr;
    unsigned long long* const all = counters + item.counters;
    auto const add = [&](int slot, std::uint64_t sum) {
        if constexpr (Packed)
            atomicAdd(mine + slot / 2, static_cast<unsigned>(sum) << (slot % 2 * 16));
        else if (mine != nullptr)
            atomicAdd(mine + static_cast<unsigned>(slot) * copies, static_cast<unsigned>(sum));
        else
            atomicAdd(all + slot, static_cast<unsigned long long>(sum));
    };
    CountRun<decltype(add)> run{add};
    T last{}; // equal voxels that follow one another are looked up once, if that is worth it
    int last_slot = -1;
    auto const slot_at = [&](T voxel) {
        if constexpr (IsCheap<SlotOf, T>) return slot_of(voxel);
        if (last_slot < 0 || differ(voxel, last)) {
            last = voxel;
            last_slot = slot_of(voxel);
        }
        return last_slot;
    };
    for (std::int64_t s = item.begin + warp; s < item.end; s += blockDim.x / 32) {
        CountSegment const segment(in, item, s);
        std::byte const* const from = segment.from;
        int const n = segment.n;
        std::int64_t const share = share_of_voxel(grid.before.y + segment.y, item.brick_y, grid.dims.y, grid.bricks.y) *
                                   share_of_voxel(grid.before.z + segment.z, item.brick_z, grid.dims.z, grid.bricks.z);
        std::int64_t const full = share * grid.bricks.x;
        auto const weight = [&](int i) {
            std::int64_t const x = segment.begin + i;
            return static_cast<std::uint64_t>(x == 0             ? share * item.first
                                              : x == item.nx - 1 ? share * item.last
                                                                 : full);
        };
        bool const aligned = reinterpret_cast<std::uintptr_t>(from) % (N * sizeof(T)) == 0;
        auto const load = [&](int i) {
            return load_words<N* static_cast<int>(sizeof(T))>(from + i * static_cast<int>(sizeof(T)), aligned);
        };
        auto const count = [&](Words const& words) {
            int found[N];
            bool one = true;
#pragma unroll
            for (int k = 0; k < N; ++k) {
                found[k] = slot_at(voxel_of<T>(words, k));
                one = one && found[k] == found[0];
            }
            if (one) return add(found[0], N);
#pragma unroll
            for (int k = 0; k < N; ++k) add(found[k], 1);
        };
        int i = static_cast<int>(lane) * N;
        // Loads that wait for memory together.
        if (plain)
            for (; i + 32 * N * (count_ahead - 1) + N <= n; i += 32 * N * count_ahead) {
                Words words[count_ahead];
#pragma unroll
                for (int k = 0; k < count_ahead; ++k) words[k] = load(i + 32 * N * k);
#pragma unroll
                for (int k = 0; k < count_ahead; ++k) count(words[k]);
            }
        for (; i < n; i += 32 * N) {
            if (i + N <= n) {
                Words const words = load(i);
                if (plain) {
                    count(words);
                    continue;
                }
#pragma unroll
                for (int k = 0; k < N; ++k) run.take(slot_of(voxel_of<T>(words, k)), weight(i + k));
            } else {
                for (int k = i; k < n; ++k) run.take(slot_of(reinterpret_cast<T const*>(from)[k]), weight(k));
            }
        }
    }
    run.flush();
    if (copies == 0) return;
    __syncthreads();
    if constexpr (Packed) {
        for (unsigned i = threadIdx.x; i < words; i += blockDim.x) {
            unsigned const pair = shared[i];
            if ((pair & 0xffff) != 0) atomicAdd(all + 2 * i, static_cast<unsigned long long>(pair & 0xffff));
            if (pair >> 16 != 0) atomicAdd(all + 2 * i + 1, static_cast<unsigned long long>(pair >> 16));
        }
    } else {
        for (unsigned i = threadIdx.x; i < slots; i += blockDim.x) {
            unsigned long long sum = 0;
            for (unsigned copy = 0; copy < copies; ++copy) sum += shared[i * copies + (copy + i) % copies];
            if (sum != 0) atomicAdd(all + i, sum);
        }
    }
}

template <class T, int N, bool Packed, class SlotOf>
void launch_count(DeviceRows const& in, std::vector<CountItem> const& items, CountGrid const& grid,
                  SlotOf const& slot_of, unsigned slots, unsigned copies, unsigned long long* counters) {
    bool const plain = grid.bricks == Index3{1, 1, 1};
    DeviceList<CountItem> const list(items);
    unsigned const bytes = Packed ? (slots + 1) / 2 * 4 : slots * copies * 4;
    if constexpr (Packed)
        cudaFuncSetAttribute(count_kernel<T, N, Packed, SlotOf>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                             static_cast<int>(bytes));
    count_kernel<T, N, Packed, SlotOf>
        <<<static_cast<unsigned>(items.size()), Packed ? packed_threads : block_threads, bytes>>>(
            in, list.get(), grid, slot_of, slots, copies, plain, counters);
    check_launch("count");
}

/// Adds to counters[brick * slots + slot_of(v)], in device memory, the weights of the voxels of `in` that lie in the
/// grid.
template <class T, class SlotOf>
void count_on_device(ConstView in, BrickGrid grid, SlotOf const& slot_of, std::size_t slots,
                     unsigned long long* counters) {
    Box slab = intersect(in.box, grid.box);
    if (slab.empty()) return;
    if (grid.count() == 1 && slab == in.box && in.contiguous()) { // one long row
        slab = {{0, 0, 0}, {in.box.voxels(), 1, 1}};
        in = dense_view(in.data, in.type, slab, in.space);
        grid.box = slab;
    }
    DeviceRows const rows = device_rows(in, in.box);
    CountGrid const cut{in.box.lower - grid.box.lower, grid.box.dims(), grid.bricks};
    double const weight =
        static_cast<double>(grid.bricks.x) * static_cast<double>(grid.bricks.y) * static_cast<double>(grid.bricks.z);
    bool const fits = slots <= most_shared_counters && weight * static_cast<double>(count_segment) < 0x1p31;
    unsigned const copies =
        !fits ? 0 : std::min(32u, std::bit_floor(most_shared_counters / static_cast<unsigned>(slots)));
    int room = 0;
    cudaDeviceGetAttribute(&room, cudaDevAttrMaxSharedMemoryPerBlockOptin, device_current());
    bool const packed = slots > most_shared_counters && slots <= most_packed_counters && grid.count() == 1 &&
                        static_cast<int>((slots + 1) / 2 * 4) <= room;
    std::vector<CountItem> const items = count_items(slab, grid, slots, in.box.lower, packed);
    constexpr int wide = std::min<int>(16, 16 / static_cast<int>(sizeof(T))),
                  narrow = std::max<int>(1, 4 / static_cast<int>(sizeof(T)));
    // Short rows leave lanes idle, the more the wider what each of them loads.
    bool const short_rows = slab.dims().x / grid.bricks.x < 32 * wide;
    constexpr int small = sizeof(T) >= 4 ? wide : narrow;
    auto const count = static_cast<unsigned>(slots);
    auto const equal = static_cast<unsigned long long>(grid.count()); // the weight of every voxel, if it is the same
    if (is_even(grid) && lane_bytes(slots_of_lanes<SlotOf>(slots)) <= most_lane_bytes)
        short_rows ? launch_count_lanes<T, small, true>(rows, items, slot_of, count, equal, counters)
                   : launch_count_lanes<T, wide, false>(rows, items, slot_of, count, equal, counters);
    else if (packed)
        launch_count<T, wide, true>(rows, items, cut, slot_of, count, 1, counters);
    else if (short_rows)
        launch_count<T, small, false>(rows, items, cut, slot_of, count, copies, counters);
    else
        launch_count<T, wide, false>(rows, items, cut, slot_of, count, copies, counters);
}

/// Counters in device memory for the time of one call, zero at first.
class DeviceCounters {
public:
    explicit DeviceCounters(std::size_t size) : size_(size), memory_(size * sizeof(unsigned long long)) {
        device_clear(memory_.get(), size * sizeof(unsigned long long));
    }
    unsigned long long* get() const { return reinterpret_cast<unsigned long long*>(memory_.get()); }
    std::vector<std::uint64_t> on_host() const {
        std::vector<std::uint64_t> counts(size_);
        copy_to_host(counts.data(), memory_.get(), size_ * sizeof(std::uint64_t));
        return counts;
    }

private:
    std::size_t size_;
    DeviceScratch memory_;
};

} // namespace vkt::VKT_BACKEND::driver
