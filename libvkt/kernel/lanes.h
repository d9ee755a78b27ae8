// Vectors as wide as the instruction set's registers, for the few kernels that block registers by hand.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

#ifndef __CUDACC__ // there a thread is a lane

namespace vkt::VKT_BACKEND {

/// Lanes<C>: as many C as a register holds, with + - * < ?: per lane.
template <class C> struct LanesOf { typedef C type __attribute__((vector_size(register_bytes))); };
template <class C> using Lanes = typename LanesOf<C>::type;

template <class C> inline constexpr std::int64_t lane_count = static_cast<std::int64_t>(register_bytes / sizeof(C));

template <class C> VKT_HD Lanes<C> load_lanes(C const* from) {
    Lanes<C> lanes;
    std::memcpy(&lanes, from, sizeof lanes);
    return lanes;
}
template <class C> VKT_HD void store_lanes(C* to, Lanes<C> lanes) { std::memcpy(to, &lanes, sizeof lanes); }

#if defined(__AVX512F__)
VKT_HD Lanes<float> madd(Lanes<float> a, Lanes<float> b, Lanes<float> c) { return _mm512_fmadd_ps(a, b, c); }
VKT_HD Lanes<double> madd(Lanes<double> a, Lanes<double> b, Lanes<double> c) { return _mm512_fmadd_pd(a, b, c); }
#elif defined(__AVX2__) && defined(__FMA__)
VKT_HD Lanes<float> madd(Lanes<float> a, Lanes<float> b, Lanes<float> c) { return _mm256_fmadd_ps(a, b, c); }
VKT_HD Lanes<double> madd(Lanes<double> a, Lanes<double> b, Lanes<double> c) { return _mm256_fmadd_pd(a, b, c); }
#else
VKT_HD Lanes<float> madd(Lanes<float> a, Lanes<float> b, Lanes<float> c) { return a * b + c; }
VKT_HD Lanes<double> madd(Lanes<double> a, Lanes<double> b, Lanes<double> c) { return a * b + c; }
#endif

} // namespace vkt::VKT_BACKEND

#endif
