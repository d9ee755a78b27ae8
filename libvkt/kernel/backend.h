// The back-end pattern: one operation source, compiled once per back end into a namespace of its own.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/device.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/view.h"

// An operation source looks like this:
//
//     #include "libvkt/kernel/kernel.h"
//     namespace vkt {
//     VKT_KERNEL(threshold, (ConstView in, AnyView out, double at, Execution const& execution), (in, out, at,
//     execution)) namespace VKT_BACKEND { template <class T> static void run(View<T const> in, View<T> out, Box const&
//     box, T at, Execution const& execution) {
//         map(execution, box, out, [=] VKT_DEVICE(T v) { return v < at ? T(0) : T(1); }, in);
//     }
//     void threshold(ConstView in, AnyView out, double at, Execution const& execution) {
//         for_each_type(in.type, [&]<class T>(T) { run<T>(in.as<T>(), out.as<T>(), out.box, round_to<T>(at),
//         execution); });
//     }
//     } // namespace VKT_BACKEND
//     #if VKT_HOST
//     void Threshold::run(...) { threshold(inputs[0], out, at_, execution); }   // the dispatcher
//     #endif
//     }
//
// Everything in namespace VKT_BACKEND is compiled as baseline, avx2, avx512 and cuda; what is inside #if VKT_HOST once.
// A lambda for the device must not be written inside a generic lambda or a private member: give it a function template.

#ifdef __CUDACC__
#define VKT_DEVICE __device__
#else
#define VKT_DEVICE
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

/// VKT_KERNEL(name, (parameters), (arguments)): declares void name(parameters) in every back end, and in the host part
/// a function of that name which chooses by the parameter called `execution`. Use it in namespace vkt, in a source.
#if VKT_HOST
#define VKT_KERNEL(name, params, args)                                                                                 \
    namespace baseline {                                                                                               \
    void name params;                                                                                                  \
    }                                                                                                                  \
    VKT_IN_X86_BACKENDS(void name params)                                                                              \
    VKT_IN_CUDA_BACKEND(void name params)                                                                              \
    static void name params {                                                                                          \
        VKT_CALL_CUDA_BACKEND(name, args)                                                                              \
        VKT_CALL_X86_BACKEND(name, args)                                                                               \
        return baseline::name args;                                                                                    \
    }
#else
#define VKT_KERNEL(name, params, args)                                                                                 \
    namespace VKT_BACKEND {                                                                                            \
    void name params;                                                                                                  \
    }
#endif

/// The same for kernels that run on CPUs only; their operations leave runs_on_gpu() false, and their back-end part
/// stands inside #ifndef __CUDACC__.
#if VKT_HOST
#define VKT_CPU_KERNEL(name, params, args)                                                                             \
    namespace baseline {                                                                                               \
    void name params;                                                                                                  \
    }                                                                                                                  \
    VKT_IN_X86_BACKENDS(void name params)                                                                              \
    static void name params {                                                                                          \
        VKT_CALL_X86_BACKEND(name, args)                                                                               \
        return baseline::name args;                                                                                    \
    }
#elif defined(__CUDACC__)
#define VKT_CPU_KERNEL(name, params, args)
#else
#define VKT_CPU_KERNEL(name, params, args)                                                                             \
    namespace VKT_BACKEND {                                                                                            \
    void name params;                                                                                                  \
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
