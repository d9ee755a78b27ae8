// Sums over the threads of a block.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

namespace vkt::VKT_BACKEND {

namespace driver {

/// What the threads before this one have, and all of them, of a block of so many; called by all of them.
template <int Threads> __device__ unsigned sum_before(unsigned mine, unsigned& total) {
    __shared__ unsigned warps[Threads / 32];
    auto const lane = static_cast<int>(threadIdx.x % 32), warp = static_cast<int>(threadIdx.x / 32);
    unsigned sum = mine;
    for (int by = 1; by < 32; by *= 2) {
        unsigned const below = __shfl_up_sync(~0u, sum, by);
        sum += lane >= by ? below : 0;
    }
    if (lane == 31) warps[warp] = sum;
    __syncthreads();
    unsigned before = 0, all = 0;
    for (int w = 0; w < Threads / 32; ++w) {
        before += w < warp ? warps[w] : 0;
        all += warps[w];
    }
    total = all;
    __syncthreads();
    return before + sum - mine;
}

} // namespace driver

} // namespace vkt::VKT_BACKEND
