// Widening and narrowing of rows: 8- and 16-bit integers with registers, which compilers do three times slower.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/rows.h"

#include <cstring>
#include <stdexcept>

#if defined(__AVX2__)
// GCC before 13 takes the undefined operands of its own intrinsics for mistakes (its bug 105593).
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#include <immintrin.h>
#endif

namespace vkt::VKT_BACKEND {
namespace {

template <class T, class C> void load_any(T const* from, C* to, std::int64_t n) {
    if constexpr (std::is_same_v<C, Int128> && !std::is_integral_v<T>)
        throw std::logic_error("128-bit integers are made of integers only");
    else
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = static_cast<C>(from[i]);
}

template <class T, class C> Losses store_any(C const* from, T* to, std::int64_t n) {
    std::int32_t clipped = 0, nan = 0;
#pragma omp simd reduction(+ : clipped, nan)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
        C const v = from[i];
        clipped += is_clipped<T>(v) ? 1 : 0;
        nan += is_lost_nan<T>(v) ? 1 : 0;
        to[i] = round_to<T>(v);
    }
    return {clipped, nan};
}

#if defined(__AVX2__)

/// Of the integers that fit into 16 bits.
template <class T> constexpr bool is_small = std::is_integral_v<T> && sizeof(T) <= 2;

#if defined(__AVX512F__)

/// Sixteen floats.
struct Floats {
    __m512 v;

    template <class T> static Floats load(T const* from) {
        auto const* const bytes = reinterpret_cast<__m128i const*>(from);
        auto const* const words = reinterpret_cast<__m256i const*>(from);
        __m512i wide;
        if constexpr (std::is_same_v<T, std::uint8_t>) wide = _mm512_cvtepu8_epi32(_mm_loadu_si128(bytes));
        if constexpr (std::is_same_v<T, std::int8_t>) wide = _mm512_cvtepi8_epi32(_mm_loadu_si128(bytes));
        if constexpr (std::is_same_v<T, std::uint16_t>) wide = _mm512_cvtepu16_epi32(_mm256_loadu_si256(words));
        if constexpr (std::is_same_v<T, std::int16_t>) wide = _mm512_cvtepi16_epi32(_mm256_loadu_si256(words));
        return {_mm512_cvtepi32_ps(wide)};
    }
    static Floats load(float const* from) { return {_mm512_loadu_ps(from)}; }
    void store(float* to) const { _mm512_storeu_ps(to, v); }
};

/// Counts in registers, one loop of at most row_piece voxels long.
struct Counter {
    std::int32_t clipped = 0, nan = 0;
    Losses total() const { return {clipped, nan}; }
};

template <class T> void store_floats(Floats f, T* to, Counter& count) {
    constexpr float lowest = std::numeric_limits<T>::lowest(), highest = std::numeric_limits<T>::max();
    __mmask16 const above = _mm512_cmp_ps_mask(f.v, _mm512_set1_ps(highest + 0.5F), _CMP_GE_OQ);
    __mmask16 const below = _mm512_cmp_ps_mask(f.v, _mm512_set1_ps(lowest - 0.5F), _CMP_LT_OQ);
    __mmask16 const number = _mm512_cmp_ps_mask(f.v, f.v, _CMP_ORD_Q);
    count.clipped += __builtin_popcount(static_cast<unsigned>(above | below));
    count.nan += 16 - __builtin_popcount(static_cast<unsigned>(number));
    __m512 const v = _mm512_maskz_mov_ps(number, f.v);
    __m512 const limited = _mm512_min_ps(_mm512_max_ps(v, _mm512_set1_ps(lowest)), _mm512_set1_ps(highest));
    __m512i const whole = _mm512_cvtps_epi32(limited);
    if constexpr (sizeof(T) == 1)
        _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm512_cvtepi32_epi8(whole));
    else
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm512_cvtepi32_epi16(whole));
}

#else

struct Floats {
    __m256 low, high;

    template <class T> static __m256 widened(T const* from) {
        auto const* const bytes = reinterpret_cast<__m128i const*>(from);
        __m256i wide;
        if constexpr (std::is_same_v<T, std::uint8_t>) wide = _mm256_cvtepu8_epi32(_mm_loadl_epi64(bytes));
        if constexpr (std::is_same_v<T, std::int8_t>) wide = _mm256_cvtepi8_epi32(_mm_loadl_epi64(bytes));
        if constexpr (std::is_same_v<T, std::uint16_t>) wide = _mm256_cvtepu16_epi32(_mm_loadu_si128(bytes));
        if constexpr (std::is_same_v<T, std::int16_t>) wide = _mm256_cvtepi16_epi32(_mm_loadu_si128(bytes));
        return _mm256_cvtepi32_ps(wide);
    }
    template <class T> static Floats load(T const* from) { return {widened(from), widened(from + 8)}; }
    static Floats load(float const* from) { return {_mm256_loadu_ps(from), _mm256_loadu_ps(from + 8)}; }
    void store(float* to) const {
        _mm256_storeu_ps(to, low);
        _mm256_storeu_ps(to + 8, high);
    }
};

struct Counter {
    __m256i clipped = _mm256_setzero_si256(), nan = _mm256_setzero_si256(); ///< minus the counts, lane by lane

    static std::int64_t sum(__m256i lanes) {
        alignas(32) std::int32_t v[8];
        _mm256_store_si256(reinterpret_cast<__m256i*>(v), lanes);
        std::int64_t total = 0;
        for (std::int32_t const lane : v) total -= lane;
        return total;
    }
    Losses total() const { return {sum(clipped), sum(nan)}; }
};

/// Limited to the type and rounded, and counted.
template <class T> __m256i whole_of(__m256 v, Counter& count) {
    constexpr float lowest = std::numeric_limits<T>::lowest(), highest = std::numeric_limits<T>::max();
    __m256 const above = _mm256_cmp_ps(v, _mm256_set1_ps(highest + 0.5F), _CMP_GE_OQ);
    __m256 const below = _mm256_cmp_ps(v, _mm256_set1_ps(lowest - 0.5F), _CMP_LT_OQ);
    __m256 const number = _mm256_cmp_ps(v, v, _CMP_ORD_Q);
    count.clipped = _mm256_add_epi32(count.clipped, _mm256_castps_si256(_mm256_or_ps(above, below)));
    count.nan = _mm256_add_epi32(count.nan, _mm256_castps_si256(_mm256_cmp_ps(v, v, _CMP_UNORD_Q)));
    v = _mm256_and_ps(v, number);
    v = _mm256_min_ps(_mm256_max_ps(v, _mm256_set1_ps(lowest)), _mm256_set1_ps(highest));
    return _mm256_cvtps_epi32(v);
}

template <class T> void store_floats(Floats f, T* to, Counter& count) {
    __m256i const a = whole_of<T>(f.low, count), b = whole_of<T>(f.high, count);
    constexpr int in_order = 0xd8; // packing works on the halves of the registers
    if constexpr (std::is_same_v<T, std::uint16_t>) {
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(to),
                            _mm256_permute4x64_epi64(_mm256_packus_epi32(a, b), in_order));
    } else {
        __m256i const words = _mm256_permute4x64_epi64(_mm256_packs_epi32(a, b), in_order);
        __m128i const low = _mm256_castsi256_si128(words), high = _mm256_extracti128_si256(words, 1);
        if constexpr (std::is_same_v<T, std::int16_t>)
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), words);
        else if constexpr (std::is_same_v<T, std::uint8_t>)
            _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm_packus_epi16(low, high));
        else
            _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm_packs_epi16(low, high));
    }
}

#endif

constexpr std::int64_t step = 16; ///< floats at a time

template <class T> void load_small(T const* from, float* to, std::int64_t n) {
    std::int64_t i = 0;
    for (; i + step <= n; i += step) Floats::load(from + i).store(to + i);
    for (; i < n; ++i) to[i] = static_cast<float>(from[i]);
}

template <class T> Losses store_small(float const* from, T* to, std::int64_t n) {
    Counter count;
    std::int64_t i = 0;
    for (; i + step <= n; i += step) store_floats(Floats::load(from + i), to + i, count);
    Losses losses = count.total();
    if (i < n) losses += store_any(from + i, to + i, n - i);
    return losses;
}

#else
template <class T> constexpr bool is_small = false;
#endif

} // namespace

template <class C> void load_row(DataType type, std::byte const* from, C* to, std::int64_t n) {
    for_each_type(type, [&]<class T>(T) {
        auto const* const in = reinterpret_cast<T const*>(from);
        if constexpr (std::is_same_v<T, C>)
            std::memcpy(to, from, static_cast<std::size_t>(n) * sizeof(C));
#if defined(__AVX2__)
        else if constexpr (is_small<T> && std::is_same_v<C, float>)
            load_small(in, to, n);
#endif
        else
            load_any(in, to, n);
    });
}

template <class C> Losses store_row(DataType type, C const* from, std::byte* to, std::int64_t n) {
    Losses losses;
    for_each_type(type, [&]<class T>(T) {
        auto* const out = reinterpret_cast<T*>(to);
        if constexpr (std::is_same_v<T, C>)
            std::memcpy(to, from, static_cast<std::size_t>(n) * sizeof(C));
#if defined(__AVX2__)
        else if constexpr (is_small<T> && std::is_same_v<C, float>)
            losses = store_small(from, out, n);
#endif
        else
            losses = store_any(from, out, n);
    });
    return losses;
}

template void load_row(DataType, std::byte const*, float*, std::int64_t);
template void load_row(DataType, std::byte const*, double*, std::int64_t);
template void load_row(DataType, std::byte const*, Int128*, std::int64_t);
template Losses store_row(DataType, float const*, std::byte*, std::int64_t);
template Losses store_row(DataType, double const*, std::byte*, std::int64_t);
template Losses store_row(DataType, Int128 const*, std::byte*, std::int64_t);

} // namespace vkt::VKT_BACKEND
