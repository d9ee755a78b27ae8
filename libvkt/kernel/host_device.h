// The qualifier of functions that kernels call: inlined into each, on CPUs and on GPUs.
// SPDX-License-Identifier: MIT
#pragma once

// Inlined always: what is compiled for one instruction set must never stand in for the others. Rooms below this one say
// constexpr instead, which CUDA's compiler takes for both as well.
#ifdef __CUDACC__
#define VKT_HD __host__ __device__ __forceinline__
#else
#define VKT_HD inline __attribute__((always_inline))
#endif
