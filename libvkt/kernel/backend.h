// The back-end pattern: one operation source, compiled once per back end into a namespace of its own.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/device.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/view.h"
#include "libvkt/kernel/host_device.h"

// Sources in folders called kernels, rows.cpp and hash.cpp are compiled as baseline, avx2, avx512 and cuda, each into
// the namespace VKT_BACKEND of its own; all others once. What is called from outside is declared in a header beside it:
//
//     // operations/voxels/kernels/flip.h
//     VKT_KERNEL(flip_box, (ConstView from, AnyView to, Axis axis, Execution const& execution), (from, to, axis,
//     execution))
//     // operations/voxels/kernels/flip.cpp
//     namespace vkt::VKT_BACKEND {
//     void flip_box(ConstView from, AnyView to, Axis axis, Execution const& execution) { ... }
//     }
//     // operations/voxels/flip.cpp
//     flip_box(inputs[0], out, axis_, execution); // the one for the device and instruction set of `execution`

#ifdef __CUDACC__
#define VKT_DEVICE __device__
#define VKT_CALLED __host__ __device__ __noinline__ inline
#else
#define VKT_DEVICE
#define VKT_CALLED inline
#endif

// Defined by the build where the other instruction sets are compiled too.
#ifdef VKT_X86_BACKENDS
#define VKT_IN_X86_BACKENDS(...)                                                                                       \
    namespace avx2 {                                                                                                   \
    __VA_ARGS__;                                                                                                       \
    }                                                                                                                  \
    namespace avx512 {                                                                                                 \
    __VA_ARGS__;                                                                                                       \
    }
#define VKT_CALL_X86_BACKEND(name, args)                                                                               \
    if (execution.instructions == InstructionSet::avx512) return avx512::name args;                                    \
    if (execution.instructions == InstructionSet::avx2) return avx2::name args;
#else
#define VKT_IN_X86_BACKENDS(...)
#define VKT_CALL_X86_BACKEND(name, args)
#endif

#ifdef VKT_CUDA
#define VKT_IN_CUDA_BACKEND(...)                                                                                       \
    namespace cuda {                                                                                                   \
    __VA_ARGS__;                                                                                                       \
    }
#define VKT_CALL_CUDA_BACKEND(name, args)                                                                              \
    if (execution.device == Device::gpu) return cuda::name args;
#else
#define VKT_IN_CUDA_BACKEND(...)
// Never a silent fallback: data that an execution puts on the device cannot be read here.
#define VKT_CALL_CUDA_BACKEND(name, args)                                                                              \
    if (execution.device == Device::gpu) throw_without_cuda();
#endif

/// VKT_KERNEL(name, (parameters), (arguments)): declares void name(parameters) in namespace vkt for every back end. In
/// kernel sources that is the function of their own back end; elsewhere one that chooses by the parameter `execution`.
/// VKT_CPU_KERNEL is for kernels that no GPU runs.
#ifdef VKT_BACKEND
#define VKT_KERNEL(name, params, args)                                                                                 \
    namespace VKT_BACKEND {                                                                                            \
    void name params;                                                                                                  \
    }
#define VKT_CPU_KERNEL(name, params, args) VKT_KERNEL(name, params, args)
#else
#define VKT_BACKEND baseline // arithmetic and drivers for sources that are compiled once
#define VKT_CPU_KERNEL(name, params, args)                                                                             \
    namespace baseline {                                                                                               \
    void name params;                                                                                                  \
    }                                                                                                                  \
    VKT_IN_X86_BACKENDS(void name params)                                                                              \
    [[maybe_unused]] static void name params {                                                                         \
        VKT_CALL_X86_BACKEND(name, args)                                                                               \
        return baseline::name args;                                                                                    \
    }
#define VKT_KERNEL(name, params, args)                                                                                 \
    namespace baseline {                                                                                               \
    void name params;                                                                                                  \
    }                                                                                                                  \
    VKT_IN_X86_BACKENDS(void name params)                                                                              \
    VKT_IN_CUDA_BACKEND(void name params)                                                                              \
    [[maybe_unused]] static void name params {                                                                         \
        VKT_CALL_CUDA_BACKEND(name, args)                                                                              \
        VKT_CALL_X86_BACKEND(name, args)                                                                               \
        return baseline::name args;                                                                                    \
    }
#endif

namespace vkt {

namespace VKT_BACKEND {

/// Bytes of a vector register of the instruction set.
#if defined(__AVX512F__)
inline constexpr std::size_t register_bytes = 64;
#elif defined(__AVX2__)
inline constexpr std::size_t register_bytes = 32;
#else
inline constexpr std::size_t register_bytes = 16;
#endif

} // namespace VKT_BACKEND
} // namespace vkt
