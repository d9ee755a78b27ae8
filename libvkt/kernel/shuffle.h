// Bytes of registers moved about, on CPUs: bits gathered, of bytes and of comparisons, blocks of voxels transposed.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

#include <cstring>
#include <type_traits>

namespace vkt::VKT_BACKEND {

/// Bit i is the least bit of byte i, which is 0 or 1.
inline std::uint64_t gathered_bits(std::uint8_t const (&flags)[64]) {
    std::uint64_t word = 0;
#if defined(__x86_64__)
    for (int i = 0; i < 64; i += 16) {
        __m128i v;
        std::memcpy(&v, flags + i, sizeof v);
        auto const part = static_cast<std::uint32_t>(_mm_movemask_epi8(_mm_slli_epi16(v, 7)));
        word |= static_cast<std::uint64_t>(part) << i;
    }
#else
    for (int i = 0; i < 64; i += 8) {
        std::uint64_t v;
        std::memcpy(&v, flags + i, sizeof v);
        word |= ((v * 0x0102040810204080u) >> 56) << i;
    }
#endif
    return word;
}

/// Whether any bit of a register is set: whether a comparison holds in any lane.
template <class V> bool any_bit(V const& lanes) {
    static_assert(sizeof(V) == register_bytes);
#if defined(__AVX512F__)
    auto const bits = reinterpret_cast<__m512i>(lanes);
    return _mm512_test_epi64_mask(bits, bits) != 0;
#elif defined(__AVX2__)
    auto const bits = reinterpret_cast<__m256i>(lanes);
    return _mm256_testz_si256(bits, bits) == 0;
#else
    std::uint64_t words[register_bytes / 8], all = 0;
    std::memcpy(words, &lanes, sizeof words);
    for (std::uint64_t const word : words) all |= word;
    return all != 0;
#endif
}

/// Four numbers side by side, as they stand in memory.
typedef double Doubles4 __attribute__((vector_size(32)));
template <class T> void load_four(T const* from, Doubles4& to) {
#if defined(__AVX2__)
    if constexpr (std::is_same_v<T, float>) { // __builtin_convertvector() of GCC 12 goes through memory
        to = _mm256_cvtps_pd(_mm_loadu_ps(from));
        return;
    }
#endif
    double values[4];
    for (int i = 0; i < 4; ++i) values[i] = static_cast<double>(from[i]);
    std::memcpy(&to, values, sizeof to);
}

/// Voxels of a register of 16 bytes; as many such registers are transposed at a time.
template <class U> constexpr std::int64_t block_edge = static_cast<std::int64_t>(16 / sizeof(U));

#if defined(__x86_64__)
template <class U> __m128i interleaved_low(__m128i a, __m128i b) {
    if constexpr (sizeof(U) == 1) return _mm_unpacklo_epi8(a, b);
    if constexpr (sizeof(U) == 2) return _mm_unpacklo_epi16(a, b);
    if constexpr (sizeof(U) == 4) return _mm_unpacklo_epi32(a, b);
    return _mm_unpacklo_epi64(a, b);
}
template <class U> __m128i interleaved_high(__m128i a, __m128i b) {
    if constexpr (sizeof(U) == 1) return _mm_unpackhi_epi8(a, b);
    if constexpr (sizeof(U) == 2) return _mm_unpackhi_epi16(a, b);
    if constexpr (sizeof(U) == 4) return _mm_unpackhi_epi32(a, b);
    return _mm_unpackhi_epi64(a, b);
}
#endif

/// to[j * to_row + i] = from[i * from_row + j] for i, j below block_edge.
template <class U> void transpose_block(U const* from, std::int64_t from_row, U* to, std::int64_t to_row) {
    constexpr std::int64_t n = block_edge<U>;
#if defined(__x86_64__)
    // Every round interleaves the first half of the registers with the second, which moves each bit of a voxel's place
    // up by one: after as many rounds as a column has bits, rows and columns have changed places.
    // Unrolled, and moved one by one, since these are registers: through memory a block would take three times as long.
    __m128i a[n], b[n];
#pragma GCC unroll 16
    for (std::int64_t i = 0; i < n; ++i) a[i] = _mm_loadu_si128(reinterpret_cast<__m128i const*>(from + i * from_row));
#pragma GCC unroll 4
    for (std::int64_t round = 1; round < n; round *= 2) {
#pragma GCC unroll 8
        for (std::int64_t i = 0; i < n / 2; ++i) {
            b[2 * i] = interleaved_low<U>(a[i], a[i + n / 2]);
            b[2 * i + 1] = interleaved_high<U>(a[i], a[i + n / 2]);
        }
#pragma GCC unroll 16
        for (std::int64_t i = 0; i < n; ++i) a[i] = b[i];
    }
#pragma GCC unroll 16
    for (std::int64_t j = 0; j < n; ++j) _mm_storeu_si128(reinterpret_cast<__m128i*>(to + j * to_row), a[j]);
#else
    for (std::int64_t j = 0; j < n; ++j)
        for (std::int64_t i = 0; i < n; ++i) to[j * to_row + i] = from[i * from_row + j];
#endif
}

} // namespace vkt::VKT_BACKEND
