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
    T low{}, high{};
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

/// Sums of the lanes of a register, as numbers of type S.
template <class S> std::int64_t sum_of_lanes(__m256i v) {
    S lanes[32 / sizeof(S)];
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(lanes), v);
    std::int64_t total = 0;
    for (S const lane : lanes) total += lane;
    return total;
}

/// The extremes and sums of `steps` times 64 bytes. All is of integers of the same sign: 8 bits without, 16 bits with
/// one, those of the other kind moved by half their range. Variables, not members of an object: those went through
/// memory with every addition, which took twice as long.
template <class T> [[gnu::always_inline]] inline IntegerSums<T> sums_of_registers(T const* p, std::int64_t steps) {
    constexpr bool bytes = sizeof(T) == 1, moved = bytes == std::is_signed_v<T>;
    constexpr std::int64_t width = 32 / sizeof(T), n_of_step = 2 * width;
    __m256i const zero = _mm256_setzero_si256(), ones = _mm256_set1_epi16(1), low_bytes = _mm256_set1_epi16(0xff);
    __m256i const flip = !moved ? zero : bytes ? _mm256_set1_epi8(-128) : _mm256_set1_epi16(-32768);
    auto const load = [&](std::int64_t i) {
        __m256i const v = _mm256_loadu_si256(reinterpret_cast<__m256i const*>(p + i));
        return moved ? _mm256_xor_si256(v, flip) : v;
    };
    __m256i low = load(0), high = low, sum = zero, squares = zero, above = zero;
    for (std::int64_t i = 0; i < steps * n_of_step; i += n_of_step) {
        __m256i const a = load(i), b = load(i + width);
        if constexpr (bytes) {
            low = _mm256_min_epu8(low, _mm256_min_epu8(a, b));
            high = _mm256_max_epu8(high, _mm256_max_epu8(a, b));
            sum = _mm256_add_epi64(sum, _mm256_add_epi64(_mm256_sad_epu8(a, zero), _mm256_sad_epu8(b, zero)));
            __m256i const a_even = _mm256_and_si256(a, low_bytes), a_odd = _mm256_srli_epi16(a, 8),
                          b_even = _mm256_and_si256(b, low_bytes), b_odd = _mm256_srli_epi16(b, 8);
            __m256i const of_a = _mm256_add_epi32(_mm256_madd_epi16(a_even, a_even), _mm256_madd_epi16(a_odd, a_odd));
            __m256i const of_b = _mm256_add_epi32(_mm256_madd_epi16(b_even, b_even), _mm256_madd_epi16(b_odd, b_odd));
            squares = _mm256_add_epi32(squares, _mm256_add_epi32(of_a, of_b));
        } else {
            low = _mm256_min_epi16(low, _mm256_min_epi16(a, b));
            high = _mm256_max_epi16(high, _mm256_max_epi16(a, b));
            sum = _mm256_add_epi32(sum, _mm256_add_epi32(_mm256_madd_epi16(a, ones), _mm256_madd_epi16(b, ones)));
            // Each of two squares, of at most 2^31 and so without a sign. The upper ones are counted once more by
            // themselves: 2^32 times those are taken off at the end.
            __m256i const of_a = _mm256_madd_epi16(a, a), of_b = _mm256_madd_epi16(b, b);
            squares = _mm256_add_epi64(squares, _mm256_add_epi64(of_a, of_b));
            above = _mm256_add_epi64(above, _mm256_add_epi64(_mm256_srli_epi64(of_a, 32), _mm256_srli_epi64(of_b, 32)));
        }
    }
    using Lane = std::conditional_t<bytes, std::uint8_t, std::int16_t>;
    Lane lows[width], highs[width];
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(lows), low);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(highs), high);
    constexpr int offset = !moved ? 0 : bytes ? -128 : 32768;
    IntegerSums<T> result;
    result.low = static_cast<T>(*std::min_element(lows, lows + width) + offset);
    result.high = static_cast<T>(*std::max_element(highs, highs + width) + offset);
    std::int64_t const n = steps * n_of_step, upper = sum_of_lanes<std::int64_t>(above);
    std::int64_t const s = bytes ? sum_of_lanes<std::int64_t>(sum) : sum_of_lanes<std::int32_t>(sum);
    std::uint64_t q =
        static_cast<std::uint64_t>(bytes ? sum_of_lanes<std::int32_t>(squares) : sum_of_lanes<std::int64_t>(squares));
    if (!bytes) q += static_cast<std::uint64_t>(upper) - (static_cast<std::uint64_t>(upper) << 32);
    // What was added was v - offset; with its sign, sums of squares of v wrap to what they are.
    result.sum = s + offset * n;
    result.squares = q + static_cast<std::uint64_t>(2 * offset * s + std::int64_t{offset} * offset * n);
    return result;
}

/// Inline, so that what is not asked for is not computed.
template <class T> [[gnu::always_inline]] inline IntegerSums<T> integer_sums(T const* p, std::int64_t n) {
    constexpr std::int64_t n_of_step = 64 / sizeof(T);
    IntegerSums<T> result{p[0], p[0]};
    std::int64_t const steps = n / n_of_step;
    if (steps > 0) result = sums_of_registers(p, steps);
    for (std::int64_t i = steps * n_of_step; i < n; ++i) result.add(p[i]);
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
