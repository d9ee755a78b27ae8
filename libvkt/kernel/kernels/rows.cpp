// Widening and narrowing of rows, once per instruction set. What a compiler makes of such loops is three times slower
// for 8 and 16 bits than the instructions made for it, so those are written with registers; the rest is left to it.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/rows.h"

#include "libvkt/kernel/numeric.h"

#include <algorithm>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace vkt::VKT_BACKEND {
namespace {

// Sixteen floats, in as many registers as the instruction set needs for them.
#if defined(__AVX512F__)

struct Sixteen {
    __m512 v;
};

Sixteen load16(float const* p) { return {_mm512_loadu_ps(p)}; }
void store16(float* p, Sixteen s) { _mm512_storeu_ps(p, s.v); }
__m128i bytes16(void const* p) { return _mm_loadu_si128(static_cast<__m128i const*>(p)); }
__m256i words16(void const* p) { return _mm256_loadu_si256(static_cast<__m256i const*>(p)); }
Sixteen widen16(std::uint8_t const* p) { return {_mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes16(p)))}; }
Sixteen widen16(std::int8_t const* p) { return {_mm512_cvtepi32_ps(_mm512_cvtepi8_epi32(bytes16(p)))}; }
Sixteen widen16(std::uint16_t const* p) { return {_mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(words16(p)))}; }
Sixteen widen16(std::int16_t const* p) { return {_mm512_cvtepi32_ps(_mm512_cvtepi16_epi32(words16(p)))}; }

/// Counts lanes by the bits of comparisons.
struct Count16 {
    std::int64_t total = 0;
    void add(__mmask16 mask) { total += __builtin_popcount(mask); }
    std::int64_t sum() const { return total; }
};

template <class T> struct Narrow16 {
    Count16 clipped, nan;
    void store(Sixteen s, T* to) {
        constexpr float low = static_cast<float>(std::numeric_limits<T>::lowest());
        constexpr float high = static_cast<float>(std::numeric_limits<T>::max());
        clipped.add(static_cast<__mmask16>(_mm512_cmp_ps_mask(s.v, _mm512_set1_ps(high + 0.5f), _CMP_GE_OQ) |
                                           _mm512_cmp_ps_mask(s.v, _mm512_set1_ps(low - 0.5f), _CMP_LT_OQ)));
        __mmask16 const number = _mm512_cmp_ps_mask(s.v, s.v, _CMP_ORD_Q);
        nan.add(static_cast<__mmask16>(~number));
        __m512 const inside =
            _mm512_min_ps(_mm512_max_ps(_mm512_maskz_mov_ps(number, s.v), _mm512_set1_ps(low)), _mm512_set1_ps(high));
        __m512i const whole = _mm512_cvtps_epi32(inside);
        if constexpr (sizeof(T) == 1)
            _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm512_cvtepi32_epi8(whole));
        else
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm512_cvtepi32_epi16(whole));
    }
};
#define VKT_ROW_REGISTERS

#elif defined(__AVX2__)

struct Sixteen {
    __m256 a, b;
};

Sixteen load16(float const* p) { return {_mm256_loadu_ps(p), _mm256_loadu_ps(p + 8)}; }
void store16(float* p, Sixteen s) {
    _mm256_storeu_ps(p, s.a);
    _mm256_storeu_ps(p + 8, s.b);
}
__m128i half_register(void const* p) { return _mm_loadl_epi64(static_cast<__m128i const*>(p)); }
__m128i whole_register(void const* p) { return _mm_loadu_si128(static_cast<__m128i const*>(p)); }
Sixteen widen16(std::uint8_t const* p) {
    return {_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(half_register(p))),
            _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(half_register(p + 8)))};
}
Sixteen widen16(std::int8_t const* p) {
    return {_mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(half_register(p))),
            _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(half_register(p + 8)))};
}
Sixteen widen16(std::uint16_t const* p) {
    return {_mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(whole_register(p))),
            _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(whole_register(p + 8)))};
}
Sixteen widen16(std::int16_t const* p) {
    return {_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(whole_register(p))),
            _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(whole_register(p + 8)))};
}

/// Counts lanes: comparisons are 0 or -1. A row has fewer than 2^31 voxels.
struct Count16 {
    __m256i total = _mm256_setzero_si256();
    void add(__m256 mask) { total = _mm256_sub_epi32(total, _mm256_castps_si256(mask)); }
    std::int64_t sum() const {
        alignas(32) std::int32_t lanes[8];
        _mm256_store_si256(reinterpret_cast<__m256i*>(lanes), total);
        std::int64_t result = 0;
        for (std::int32_t lane : lanes) result += lane;
        return result;
    }
};

template <class T> struct Narrow16 {
    Count16 clipped, nan;
    __m256i whole(__m256 v) {
        constexpr float low = static_cast<float>(std::numeric_limits<T>::lowest());
        constexpr float high = static_cast<float>(std::numeric_limits<T>::max());
        clipped.add(_mm256_or_ps(_mm256_cmp_ps(v, _mm256_set1_ps(high + 0.5f), _CMP_GE_OQ),
                                 _mm256_cmp_ps(v, _mm256_set1_ps(low - 0.5f), _CMP_LT_OQ)));
        __m256 const odd = _mm256_cmp_ps(v, v, _CMP_UNORD_Q);
        nan.add(odd);
        v = _mm256_andnot_ps(odd, v);
        return _mm256_cvtps_epi32(_mm256_min_ps(_mm256_max_ps(v, _mm256_set1_ps(low)), _mm256_set1_ps(high)));
    }
    void store(Sixteen s, T* to) {
        __m256i const a = whole(s.a), b = whole(s.b);
        // Packing works within halves of a register: put the quarters back in order.
        __m256i const words = _mm256_permute4x64_epi64(
            std::is_same_v<T, std::uint16_t> ? _mm256_packus_epi32(a, b) : _mm256_packs_epi32(a, b), 0xd8);
        if constexpr (sizeof(T) == 2) {
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), words);
        } else {
            __m128i const low = _mm256_castsi256_si128(words), high = _mm256_extracti128_si256(words, 1);
            _mm_storeu_si128(reinterpret_cast<__m128i*>(to),
                             std::is_signed_v<T> ? _mm_packs_epi16(low, high) : _mm_packus_epi16(low, high));
        }
    }
};
#define VKT_ROW_REGISTERS

#elif defined(__x86_64__)

struct Sixteen {
    __m128 v[4];
};

Sixteen load16(float const* p) {
    return {{_mm_loadu_ps(p), _mm_loadu_ps(p + 4), _mm_loadu_ps(p + 8), _mm_loadu_ps(p + 12)}};
}
void store16(float* p, Sixteen s) {
    for (int i = 0; i < 4; ++i) _mm_storeu_ps(p + 4 * i, s.v[i]);
}
/// Sixteen words as floats; `upper` holds what extends each of them: zeros or copies of its sign.
Sixteen widen_words(__m128i a, __m128i b, __m128i upper_a, __m128i upper_b) {
    return {{_mm_cvtepi32_ps(_mm_unpacklo_epi16(a, upper_a)), _mm_cvtepi32_ps(_mm_unpackhi_epi16(a, upper_a)),
             _mm_cvtepi32_ps(_mm_unpacklo_epi16(b, upper_b)), _mm_cvtepi32_ps(_mm_unpackhi_epi16(b, upper_b))}};
}
__m128i whole_register(void const* p) { return _mm_loadu_si128(static_cast<__m128i const*>(p)); }
Sixteen widen16(std::uint16_t const* p) {
    __m128i const zero = _mm_setzero_si128();
    return widen_words(whole_register(p), whole_register(p + 8), zero, zero);
}
Sixteen widen16(std::int16_t const* p) {
    __m128i const a = whole_register(p), b = whole_register(p + 8);
    return widen_words(a, b, _mm_srai_epi16(a, 15), _mm_srai_epi16(b, 15));
}
Sixteen widen16(std::uint8_t const* p) {
    __m128i const v = whole_register(p), zero = _mm_setzero_si128();
    return widen_words(_mm_unpacklo_epi8(v, zero), _mm_unpackhi_epi8(v, zero), zero, zero);
}
Sixteen widen16(std::int8_t const* p) {
    __m128i const v = whole_register(p);
    __m128i const a = _mm_srai_epi16(_mm_unpacklo_epi8(v, v), 8), b = _mm_srai_epi16(_mm_unpackhi_epi8(v, v), 8);
    return widen_words(a, b, _mm_srai_epi16(a, 15), _mm_srai_epi16(b, 15));
}

struct Count16 {
    __m128i total = _mm_setzero_si128();
    void add(__m128 mask) { total = _mm_sub_epi32(total, _mm_castps_si128(mask)); }
    std::int64_t sum() const {
        alignas(16) std::int32_t lanes[4];
        _mm_store_si128(reinterpret_cast<__m128i*>(lanes), total);
        return std::int64_t{lanes[0]} + lanes[1] + lanes[2] + lanes[3];
    }
};

template <class T> struct Narrow16 {
    Count16 clipped, nan;
    __m128i whole(__m128 v) {
        constexpr float low = static_cast<float>(std::numeric_limits<T>::lowest());
        constexpr float high = static_cast<float>(std::numeric_limits<T>::max());
        clipped.add(_mm_or_ps(_mm_cmpge_ps(v, _mm_set1_ps(high + 0.5f)), _mm_cmplt_ps(v, _mm_set1_ps(low - 0.5f))));
        __m128 const odd = _mm_cmpunord_ps(v, v);
        nan.add(odd);
        v = _mm_min_ps(_mm_max_ps(_mm_andnot_ps(odd, v), _mm_set1_ps(low)), _mm_set1_ps(high));
        __m128i const n = _mm_cvtps_epi32(v);
        // Packing saturates to signed words only: unsigned ones pass it 32768 lower.
        return std::is_same_v<T, std::uint16_t> ? _mm_sub_epi32(n, _mm_set1_epi32(32768)) : n;
    }
    void store(Sixteen s, T* to) {
        __m128i a = _mm_packs_epi32(whole(s.v[0]), whole(s.v[1]));
        __m128i b = _mm_packs_epi32(whole(s.v[2]), whole(s.v[3]));
        auto* const out = reinterpret_cast<__m128i*>(to);
        if constexpr (sizeof(T) == 1) {
            _mm_storeu_si128(out, std::is_signed_v<T> ? _mm_packs_epi16(a, b) : _mm_packus_epi16(a, b));
        } else {
            if constexpr (!std::is_signed_v<T>) {
                __m128i const offset = _mm_set1_epi16(static_cast<short>(-32768));
                a = _mm_xor_si128(a, offset);
                b = _mm_xor_si128(b, offset);
            }
            _mm_storeu_si128(out, a);
            _mm_storeu_si128(out + 1, b);
        }
    }
};
#define VKT_ROW_REGISTERS

#endif

template <class T, class C> void load(T const* from, C* to, std::int64_t n) {
    std::int64_t i = 0;
#ifdef VKT_ROW_REGISTERS
    if constexpr (std::is_same_v<C, float> && std::is_integral_v<T> && sizeof(T) <= 2)
        for (; i + 16 <= n; i += 16) store16(to + i, widen16(from + i));
#endif
#pragma omp simd
    for (std::int64_t j = i; j < n; ++j) to[j] = static_cast<C>(from[j]);
}

template <class T, class C> Losses store(C const* from, T* to, std::int64_t n) {
    Losses losses;
    std::int64_t i = 0;
#ifdef VKT_ROW_REGISTERS
    if constexpr (std::is_same_v<C, float> && std::is_integral_v<T> && sizeof(T) <= 2) {
        Narrow16<T> narrow;
        for (; i + 16 <= n; i += 16) narrow.store(load16(from + i), to + i);
        losses.clipped = narrow.clipped.sum();
        losses.nan = narrow.nan.sum();
    }
#endif
    std::int32_t clipped = 0, nan = 0;
#pragma omp simd reduction(+ : clipped, nan)
    for (std::int64_t j = i; j < n; ++j) {
        clipped += is_clipped<T>(from[j]) ? 1 : 0;
        nan += is_lost_nan<T>(from[j]) ? 1 : 0;
        to[j] = round_to<T>(from[j]);
    }
    losses.clipped += clipped;
    losses.nan += nan;
    return losses;
}

} // namespace

template <class C> void load_row(DataType type, std::byte const* from, C* to, std::int64_t n) {
    for_each_type(type, [&]<class T>(T) { load(reinterpret_cast<T const*>(from), to, n); });
}

template <class C> Losses store_row(DataType type, C const* from, std::byte* to, std::int64_t n) {
    Losses losses;
    for_each_type(type, [&]<class T>(T) { losses = store(from, reinterpret_cast<T*>(to), n); });
    return losses;
}

template void load_row(DataType, std::byte const*, float*, std::int64_t);
template void load_row(DataType, std::byte const*, double*, std::int64_t);
template Losses store_row(DataType, float const*, std::byte*, std::int64_t);
template Losses store_row(DataType, double const*, std::byte*, std::int64_t);

} // namespace vkt::VKT_BACKEND
