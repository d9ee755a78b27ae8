// Runs of the bits of a mask on a GPU: which words they lie in, and sums of what comes before each.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_sums.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/operations/shape/kernels/device_components.h"

namespace vkt::VKT_BACKEND::components {

inline constexpr int block = 256;

/// Rows of bits, and rows of runs: of `group` by `group` rows of bits together.
struct Rows {
    unsigned* bits;
    unsigned* changed;              ///< null if values do not matter
    std::int64_t nx, ny, nz, words; ///< voxels; words of a row
    int group;
    std::int64_t run_ny, run_nz;

    __device__ unsigned row(std::int64_t y, std::int64_t z, std::int64_t w) const {
        bool const inside = y >= 0 && y < ny && z >= 0 && z < nz && w >= 0 && w < words;
        return inside ? bits[(z * ny + y) * words + w] : 0u;
    }
    /// All rows that a row of runs is made of.
    __device__ unsigned all(std::int64_t run_y, std::int64_t run_z, std::int64_t w) const {
        if (group == 1) return row(run_y, run_z, w);
        return row(2 * run_y, 2 * run_z, w) | row(2 * run_y + 1, 2 * run_z, w) | row(2 * run_y, 2 * run_z + 1, w) |
               row(2 * run_y + 1, 2 * run_z + 1, w);
    }
    /// Bits of a word at which runs begin.
    __device__ unsigned starts(std::int64_t run_y, std::int64_t run_z, std::int64_t w) const {
        unsigned const here = all(run_y, run_z, w);
        if (here == 0) return 0;
        unsigned const first = here & ~(here << 1 | all(run_y, run_z, w - 1) >> 31);
        return changed == nullptr ? first : first | (here & changed[word(run_y, run_z, w)]);
    }
    __device__ std::int64_t word(std::int64_t run_y, std::int64_t run_z, std::int64_t w) const {
        return (run_z * run_ny + run_y) * words + w;
    }
    std::int64_t run_words() const { return words * run_ny * run_nz; }
};

/// A word of a row of runs.
struct Place {
    std::int64_t y, z, w;
};
__device__ inline Place place_of(Rows const& rows, std::int64_t i) {
    std::int64_t const r = driver::quotient_of(i, rows.words), z = driver::quotient_of(r, rows.run_ny);
    return {r - z * rows.run_ny, z, i - r * rows.words};
}
__device__ inline std::int64_t this_thread() { return static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x; }

inline unsigned blocks_for(std::int64_t threads) { return launch_blocks((threads + block - 1) / block); }

inline Rows rows_of(DeviceComponents& components) {
    Index3 const n = components.dims;
    int const group = components.connectivity == 26 && !components.by_value ? 2 : 1;
    return {reinterpret_cast<unsigned*>(components.bits.update(Space::device)),
            components.by_value ? reinterpret_cast<unsigned*>(components.changed.update(Space::device)) : nullptr,
            n.x,
            n.y,
            n.z,
            (n.x + 31) / 32,
            group,
            (n.y + group - 1) / group,
            (n.z + group - 1) / group};
}

// Sums of what comes before each item, in three steps.

inline constexpr int items_of_thread = 4;

/// With `before` what comes before each of n items, given sums of blocks; without it these sums.
template <class Count>
__global__ void __launch_bounds__(block)
    sums_kernel(std::int64_t n, __grid_constant__ Count const count, unsigned long long* sums, unsigned* before) {
    std::int64_t const first = this_thread() * items_of_thread;
    unsigned counts[items_of_thread], mine = 0, total = 0;
    for (int k = 0; k < items_of_thread; ++k) {
        counts[k] = first + k < n ? count(first + k) : 0;
        mine += counts[k];
    }
    unsigned sum = driver::sum_before<block>(mine, total);
    if (before == nullptr) {
        if (threadIdx.x == 0) sums[blockIdx.x] = total;
        return;
    }
    sum += static_cast<unsigned>(sums[blockIdx.x]);
    for (int k = 0; k < items_of_thread && first + k < n; ++k) {
        before[first + k] = sum;
        sum += counts[k];
    }
}

/// In place; the sum of all comes last.
static __global__ void __launch_bounds__(1024) blocks_kernel(unsigned long long* sums, std::int64_t n) {
    __shared__ unsigned long long warps[32];
    auto const lane = static_cast<int>(threadIdx.x % 32), warp = static_cast<int>(threadIdx.x / 32);
    unsigned long long carried = 0;
    for (std::int64_t begin = 0; begin < n; begin += 1024) {
        std::int64_t const i = begin + threadIdx.x;
        unsigned long long const mine = i < n ? sums[i] : 0;
        unsigned long long sum = mine;
        for (int by = 1; by < 32; by *= 2) {
            unsigned long long const below = __shfl_up_sync(~0u, sum, by);
            sum += lane >= by ? below : 0;
        }
        if (lane == 31) warps[warp] = sum;
        __syncthreads();
        unsigned long long before = 0, all = 0;
        for (int w = 0; w < 32; ++w) {
            before += w < warp ? warps[w] : 0;
            all += warps[w];
        }
        if (i < n) sums[i] = carried + before + sum - mine;
        carried += all;
        __syncthreads();
    }
    if (threadIdx.x == 0) sums[n] = carried;
}

template <class Count> std::uint64_t sums_before(std::int64_t n, Count const& count, unsigned* before) {
    unsigned const blocks = blocks_for((n + items_of_thread - 1) / items_of_thread);
    driver::DeviceScratch const memory((static_cast<std::size_t>(blocks) + 1) * 8);
    auto* const sums = reinterpret_cast<unsigned long long*>(memory.get());
    sums_kernel<Count><<<blocks, block>>>(n, count, sums, nullptr);
    blocks_kernel<<<1, 1024>>>(sums, blocks);
    sums_kernel<Count><<<blocks, block>>>(n, count, sums, before);
    check_launch("label");
    std::uint64_t total = 0;
    copy_to_host(&total, sums + blocks, sizeof total);
    return total;
}

struct CountStarts {
    Rows rows;
    std::int64_t first = 0; ///< word
    __device__ unsigned operator()(std::int64_t i) const {
        Place const p = place_of(rows, first + i);
        return static_cast<unsigned>(__popc(rows.starts(p.y, p.z, p.w)));
    }
};
struct CountBits {
    unsigned const* bits;
    __device__ unsigned operator()(std::int64_t i) const { return static_cast<unsigned>(__popc(bits[i])); }
};

} // namespace vkt::VKT_BACKEND::components
