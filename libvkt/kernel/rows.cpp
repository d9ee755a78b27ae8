// Widening and narrowing of rows: 8- and 16-bit integers with registers, which compilers do three times slower.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/rows.h"

#include <cstring>
#include <stdexcept>

#if defined(__AVX2__)
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

/// Whole numbers nearest to floats or doubles, halves to even: what is no number or beyond an integer becomes the least
/// one, which is outside of T. So whole numbers tell which voxels are lost.
#if defined(__AVX512F__)

struct Whole {
    static constexpr std::int64_t lanes = 16;
    __m512i v;

    static Whole of(float const* from) { return {_mm512_cvtps_epi32(_mm512_loadu_ps(from))}; }
    static Whole of(double const* from) {
        __m256i const low = _mm512_cvtpd_epi32(_mm512_loadu_pd(from)),
                      high = _mm512_cvtpd_epi32(_mm512_loadu_pd(from + 8));
        return {_mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1)};
    }
    static Whole of(std::int32_t value) { return {_mm512_set1_epi32(value)}; }
    Whole operator|(Whole other) const { return {_mm512_or_si512(v, other.v)}; }
    Whole operator+(Whole other) const { return {_mm512_add_epi32(v, other.v)}; }
    bool any(std::int32_t bits) const { return _mm512_test_epi32_mask(v, _mm512_set1_epi32(bits)) != 0; }
};

template <class T> void load_floats(T const* from, float* to) {
    auto const* const bytes = reinterpret_cast<__m128i const*>(from);
    auto const* const words = reinterpret_cast<__m256i const*>(from);
    __m512i wide;
    if constexpr (std::is_same_v<T, std::uint8_t>) wide = _mm512_cvtepu8_epi32(_mm_loadu_si128(bytes));
    if constexpr (std::is_same_v<T, std::int8_t>) wide = _mm512_cvtepi8_epi32(_mm_loadu_si128(bytes));
    if constexpr (std::is_same_v<T, std::uint16_t>) wide = _mm512_cvtepu16_epi32(_mm256_loadu_si256(words));
    if constexpr (std::is_same_v<T, std::int16_t>) wide = _mm512_cvtepi16_epi32(_mm256_loadu_si256(words));
    _mm512_storeu_ps(to, _mm512_cvtepi32_ps(wide));
}

/// Stores 32 whole numbers of T.
template <class T> void store_whole(Whole const (&whole)[2], T* to) {
    for (int i = 0; i < 2; ++i)
        if constexpr (sizeof(T) == 1)
            _mm_storeu_si128(reinterpret_cast<__m128i*>(to + 16 * i), _mm512_cvtepi32_epi8(whole[i].v));
        else
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + 16 * i), _mm512_cvtepi32_epi16(whole[i].v));
}

#else

struct Whole {
    static constexpr std::int64_t lanes = 8;
    __m256i v;

    static Whole of(float const* from) { return {_mm256_cvtps_epi32(_mm256_loadu_ps(from))}; }
    static Whole of(double const* from) {
        __m128i const low = _mm256_cvtpd_epi32(_mm256_loadu_pd(from)),
                      high = _mm256_cvtpd_epi32(_mm256_loadu_pd(from + 4));
        return {_mm256_set_m128i(high, low)};
    }
    static Whole of(std::int32_t value) { return {_mm256_set1_epi32(value)}; }
    Whole operator|(Whole other) const { return {_mm256_or_si256(v, other.v)}; }
    Whole operator+(Whole other) const { return {_mm256_add_epi32(v, other.v)}; }
    bool any(std::int32_t bits) const { return _mm256_testz_si256(v, _mm256_set1_epi32(bits)) == 0; }
};

template <class T> void load_floats(T const* from, float* to) {
    auto const* const bytes = reinterpret_cast<__m128i const*>(from);
    __m256i wide;
    if constexpr (std::is_same_v<T, std::uint8_t>) wide = _mm256_cvtepu8_epi32(_mm_loadl_epi64(bytes));
    if constexpr (std::is_same_v<T, std::int8_t>) wide = _mm256_cvtepi8_epi32(_mm_loadl_epi64(bytes));
    if constexpr (std::is_same_v<T, std::uint16_t>) wide = _mm256_cvtepu16_epi32(_mm_loadu_si128(bytes));
    if constexpr (std::is_same_v<T, std::int16_t>) wide = _mm256_cvtepi16_epi32(_mm_loadu_si128(bytes));
    _mm256_storeu_ps(to, _mm256_cvtepi32_ps(wide));
}

/// Stores 32 whole numbers of T. Packing works on the halves of registers, which are put in order at the end.
template <class T> void store_whole(Whole const (&whole)[4], T* to) {
    if constexpr (sizeof(T) == 2) {
        for (int i = 0; i < 2; ++i) {
            __m256i const a = whole[2 * i].v, b = whole[2 * i + 1].v;
            __m256i const words = std::is_signed_v<T> ? _mm256_packs_epi32(a, b) : _mm256_packus_epi32(a, b);
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + 16 * i), _mm256_permute4x64_epi64(words, 0xd8));
        }
    } else {
        __m256i const a = _mm256_packs_epi32(whole[0].v, whole[1].v), b = _mm256_packs_epi32(whole[2].v, whole[3].v);
        __m256i const bytes = std::is_signed_v<T> ? _mm256_packs_epi16(a, b) : _mm256_packus_epi16(a, b);
        __m256i const order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_permutevar8x32_epi32(bytes, order));
    }
}

#endif

constexpr std::int64_t step = 32; ///< floats at a time

template <class T> void load_small(T const* from, float* to, std::int64_t n) {
    std::int64_t i = 0;
    for (; i + step <= n; i += step)
#pragma GCC unroll 4
        for (std::int64_t j = 0; j < step; j += Whole::lanes) load_floats(from + i + j, to + i + j);
    for (; i < n; ++i) to[i] = static_cast<float>(from[i]);
}

/// Stores whole steps of the n values, and says whether all of them were in range; if not, some of them are wrong.
template <class T, class C> bool store_in_range(C const* from, T* to, std::int64_t n) {
    // Of a signed type, the least becomes 0: what is outside has bits above those of T either way.
    constexpr std::int32_t outside = ~static_cast<std::int32_t>(std::numeric_limits<std::make_unsigned_t<T>>::max());
    Whole const offset = Whole::of(-static_cast<std::int32_t>(std::numeric_limits<T>::lowest()));
    Whole seen = Whole::of(std::int32_t{0});
    for (std::int64_t i = 0; i + step <= n; i += step) {
        Whole whole[step / Whole::lanes];
#pragma GCC unroll 4
        for (std::int64_t j = 0; j < step / Whole::lanes; ++j) {
            whole[j] = Whole::of(from + i + j * Whole::lanes);
            seen = seen | (std::is_signed_v<T> ? whole[j] + offset : whole[j]);
        }
        store_whole(whole, to + i);
    }
    return !seen.any(outside);
}

template <class T, class C> Losses store_small(C const* from, T* to, std::int64_t n) {
    Losses losses;
    for (; n > row_piece; from += row_piece, to += row_piece, n -= row_piece)
        losses += store_small(from, to, row_piece);
    std::int64_t const steps = n / step * step;
    if (!store_in_range(from, to, steps)) { // once more, limited and counted
        constexpr C lowest = std::numeric_limits<T>::lowest(), highest = std::numeric_limits<T>::max();
        alignas(64) C limited[row_piece];
        std::int32_t clipped = 0, nan = 0;
#pragma omp simd reduction(+ : clipped, nan)
        for (std::int32_t i = 0; i < static_cast<std::int32_t>(steps); ++i) {
            C v = from[i];
            clipped += is_clipped<T>(v) ? 1 : 0;
            nan += v != v ? 1 : 0; // NOLINT(misc-redundant-expression): NaN
            v = v == v ? v : C(0); // NOLINT(misc-redundant-expression): NaN
            v = v > lowest ? v : lowest;
            limited[i] = v < highest ? v : highest;
        }
        store_in_range(static_cast<C const*>(limited), to, steps);
        losses += {clipped, nan};
    }
    if (steps < n) losses += store_any(from + steps, to + steps, n - steps);
    return losses;
}

#else
template <class T> [[maybe_unused]] constexpr bool is_small = false;
#endif

} // namespace

template <class C> void load_row(DataType type, std::byte const* from, C* to, std::int64_t n) {
    with_type(type, [&]<class T>(T) {
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
    with_type(type, [&]<class T>(T) {
        auto* const out = reinterpret_cast<T*>(to);
        if constexpr (std::is_same_v<T, C>)
            std::memcpy(to, from, static_cast<std::size_t>(n) * sizeof(C));
#if defined(__AVX2__)
        else if constexpr (is_small<T> && std::is_floating_point_v<C>)
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
