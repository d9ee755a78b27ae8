// The qualifier of functions that kernels call: inlined into each, on CPUs and on GPUs.
// SPDX-License-Identifier: MIT
#pragma once

// Inlined always: what is compiled for one instruction set must never stand in for the others. Rooms below this one say
// constexpr instead, which CUDA's compiler takes for both as well.
#ifdef __CUDACC__
#define VKT_HD __host__ __device__ __forceinline__
/// Of what is called from so many places that it stays a function: its template has an argument that only one object
/// file knows, so that it is that file's own.
#define VKT_HD_CALLED __host__ __device__ __noinline__
#else
#define VKT_HD inline __attribute__((always_inline))
#define VKT_HD_CALLED __attribute__((noinline))
#endif
