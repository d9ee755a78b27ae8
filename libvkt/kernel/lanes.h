// Vectors as wide as the instruction set's registers, for the few kernels that block registers by hand.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <cstring>
#include <type_traits>

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

/// As many voxels as a register holds doubles, as doubles. Where there are registers, GCC 12 takes those apart that
/// __builtin_convertvector() is to widen.
template <class T> Lanes<double> load_doubles(T const* from) {
#if defined(__AVX512F__)
    [[maybe_unused]] auto const* const bytes = reinterpret_cast<__m128i const*>(from);
    constexpr __mmask8 all = 0xff; // of what there is without masks, GCC 12 says that it is not initialised
    if constexpr (std::is_same_v<T, float>) return _mm512_maskz_cvtps_pd(all, _mm256_loadu_ps(from));
    if constexpr (std::is_same_v<T, std::uint8_t>)
        return _mm512_maskz_cvtepi32_pd(all, _mm256_cvtepu8_epi32(_mm_loadl_epi64(bytes)));
    if constexpr (std::is_same_v<T, std::int8_t>)
        return _mm512_maskz_cvtepi32_pd(all, _mm256_cvtepi8_epi32(_mm_loadl_epi64(bytes)));
    if constexpr (std::is_same_v<T, std::uint16_t>)
        return _mm512_maskz_cvtepi32_pd(all, _mm256_cvtepu16_epi32(_mm_loadu_si128(bytes)));
    if constexpr (std::is_same_v<T, std::int16_t>)
        return _mm512_maskz_cvtepi32_pd(all, _mm256_cvtepi16_epi32(_mm_loadu_si128(bytes)));
#elif defined(__AVX2__)
    if constexpr (std::is_same_v<T, float>) return _mm256_cvtps_pd(_mm_loadu_ps(from));
    if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
        std::int64_t packed = 0;
        std::memcpy(&packed, from, 4 * sizeof(T));
        __m128i const bytes = _mm_cvtsi64_si128(packed);
        if constexpr (std::is_same_v<T, std::uint8_t>) return _mm256_cvtepi32_pd(_mm_cvtepu8_epi32(bytes));
        if constexpr (std::is_same_v<T, std::int8_t>) return _mm256_cvtepi32_pd(_mm_cvtepi8_epi32(bytes));
        if constexpr (std::is_same_v<T, std::uint16_t>) return _mm256_cvtepi32_pd(_mm_cvtepu16_epi32(bytes));
        if constexpr (std::is_same_v<T, std::int16_t>) return _mm256_cvtepi32_pd(_mm_cvtepi16_epi32(bytes));
    }
#endif
    if constexpr (std::is_arithmetic_v<T>) {
        typedef T Part __attribute__((vector_size(lane_count<double> * sizeof(T)), aligned(sizeof(T)), may_alias));
        return __builtin_convertvector(*reinterpret_cast<Part const*>(from), Lanes<double>);
    } else {
        Lanes<double> lanes;
        for (std::int64_t i = 0; i < lane_count<double>; ++i) lanes[i] = static_cast<double>(from[i]);
        return lanes;
    }
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
