// Extremes, sums and sums of squares of rows of 8- and 16-bit integers, exactly: with registers where there are some.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/backend.h"

#include <algorithm>
#include <cstdint>
#include <type_traits>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace vkt::VKT_BACKEND {

inline constexpr std::int64_t most_integers = 1 << 14; ///< that are added at a time

/// Of at least one and at most most_integers integers of type T.
template <class T> struct IntegerSums {
    T low, high;
    std::int64_t sum = 0;
    std::uint64_t squares = 0;

    void add(T v) {
        low = v < low ? v : low;
        high = v > high ? v : high;
        sum += v;
        squares += static_cast<std::uint64_t>(static_cast<std::int64_t>(v) * v);
    }
};

#if defined(__AVX2__)

/// Thirty-two bytes of 8- or 16-bit integers at a time.
template <class T> class IntegerLanes {
public:
    static constexpr std::int64_t width = 32 / sizeof(T);

    explicit IntegerLanes(T const* first) : low_(load(first)), high_(low_) {}

    void add(T const* from) {
        __m256i const v = load(from), zero = _mm256_setzero_si256();
        if constexpr (sizeof(T) == 1) {
            low_ = is_signed ? _mm256_min_epi8(low_, v) : _mm256_min_epu8(low_, v);
            high_ = is_signed ? _mm256_max_epi8(high_, v) : _mm256_max_epu8(high_, v);
            __m256i const above = is_signed ? _mm256_xor_si256(v, _mm256_set1_epi8(-128)) : v;
            sum_ = _mm256_add_epi64(sum_, _mm256_sad_epu8(above, zero));
            __m128i const a = _mm256_castsi256_si128(v), b = _mm256_extracti128_si256(v, 1);
            __m256i const wide_a = is_signed ? _mm256_cvtepi8_epi16(a) : _mm256_cvtepu8_epi16(a);
            __m256i const wide_b = is_signed ? _mm256_cvtepi8_epi16(b) : _mm256_cvtepu8_epi16(b);
            squares_ = _mm256_add_epi32(
                squares_, _mm256_add_epi32(_mm256_madd_epi16(wide_a, wide_a), _mm256_madd_epi16(wide_b, wide_b)));
        } else {
            low_ = is_signed ? _mm256_min_epi16(low_, v) : _mm256_min_epu16(low_, v);
            high_ = is_signed ? _mm256_max_epi16(high_, v) : _mm256_max_epu16(high_, v);
            __m256i const centred = is_signed ? v : _mm256_xor_si256(v, _mm256_set1_epi16(-32768));
            sum_ = _mm256_add_epi32(sum_, _mm256_madd_epi16(centred, _mm256_set1_epi16(1)));
            __m256i const pairs = _mm256_madd_epi16(centred, centred); // at most 2^31, taken without a sign
            squares_ = _mm256_add_epi64(squares_, _mm256_and_si256(pairs, _mm256_set1_epi64x(0xffffffff)));
            squares_ = _mm256_add_epi64(squares_, _mm256_srli_epi64(pairs, 32));
        }
    }

    /// Of `n` integers.
    IntegerSums<T> total(std::int64_t n) const {
        T lows[width], highs[width];
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(lows), low_);
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(highs), high_);
        IntegerSums<T> result{lows[0], highs[0]};
        for (std::int64_t i = 1; i < width; ++i) {
            result.low = std::min(result.low, lows[i]);
            result.high = std::max(result.high, highs[i]);
        }
        if constexpr (sizeof(T) == 1) {
            result.sum = sum_of<std::int64_t>(sum_) - (is_signed ? 128 * n : 0);
            result.squares = static_cast<std::uint64_t>(sum_of<std::int32_t>(squares_));
        } else {
            constexpr std::int64_t centre = is_signed ? 0 : 32768;
            std::int64_t const sum = sum_of<std::int32_t>(sum_), squares = sum_of<std::int64_t>(squares_);
            result.sum = sum + centre * n;
            result.squares = static_cast<std::uint64_t>(squares + 2 * centre * sum + centre * centre * n);
        }
        return result;
    }

private:
    static constexpr bool is_signed = std::is_signed_v<T>;

    static __m256i load(T const* from) { return _mm256_loadu_si256(reinterpret_cast<__m256i const*>(from)); }
    template <class S> static std::int64_t sum_of(__m256i v) {
        S lanes[32 / sizeof(S)];
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(lanes), v);
        std::int64_t total = 0;
        for (S const lane : lanes) total += lane;
        return total;
    }

    __m256i low_, high_, sum_ = _mm256_setzero_si256(), squares_ = _mm256_setzero_si256();
};

template <class T> IntegerSums<T> integer_sums(T const* p, std::int64_t n) {
    constexpr std::int64_t width = IntegerLanes<T>::width;
    IntegerSums<T> result{p[0], p[0]};
    std::int64_t i = 0;
    if (n >= width) {
        IntegerLanes<T> lanes(p);
        for (; i + width <= n; i += width) {
            __builtin_prefetch(p + i + 4096 / sizeof(T));
            lanes.add(p + i);
        }
        result = lanes.total(i);
    }
    for (; i < n; ++i) result.add(p[i]);
    return result;
}

#else

template <class T> IntegerSums<T> integer_sums(T const* p, std::int64_t n) {
    std::int32_t sum = 0;
    std::uint64_t squares = 0;
    T low = p[0], high = p[0];
    for (std::int64_t i = 0; i < n; ++i) {
        std::int32_t const v = p[i];
        auto const size = static_cast<std::uint32_t>(v < 0 ? -v : v);
        low = p[i] < low ? p[i] : low;
        high = p[i] > high ? p[i] : high;
        sum += v;
        squares += size * size;
    }
    return {low, high, sum, squares};
}

#endif

} // namespace vkt::VKT_BACKEND
