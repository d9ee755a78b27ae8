// As many numbers as a register holds, with the operators of the language: what loops over arrays do not become by
// themselves. Comparisons give masks, all bits of a lane or none.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/intrinsics.h"
#include "libvkt/render/inner/vector.h"

#include <cmath>
#include <cstdint>
#include <cstring>

namespace vkt::render {

#if defined(__AVX512F__)
inline constexpr int wide = 16;
#elif defined(__AVX2__)
inline constexpr int wide = 8;
#else
inline constexpr int wide = 4;
#endif
using Floats = float __attribute__((vector_size(4 * wide)));
using Ints = std::int32_t __attribute__((vector_size(4 * wide)));
using Doubles = double __attribute__((vector_size(4 * wide))); ///< half as many
using QuadInts = std::int32_t __attribute__((vector_size(16)));

VKT_HD Floats all_of(float a) { return a - Floats{}; } // keeps the sign of zero
VKT_HD Ints all_of(std::int32_t a) { return a - Ints{}; }
VKT_HD Doubles all_of(double a) { return a - Doubles{}; }
/// 0, 1, 2, …
VKT_HD Floats counting() {
    Floats a;
    for (int i = 0; i < wide; ++i) a[i] = static_cast<float>(i);
    return a;
}
VKT_HD Doubles counting_doubles() {
    Doubles a;
    for (int i = 0; i < wide / 2; ++i) a[i] = i;
    return a;
}
VKT_HD Floats floats_at(float const* p) {
    Floats a;
    std::memcpy(&a, p, sizeof a);
    return a;
}
VKT_HD Ints ints_at(std::int32_t const* p) {
    Ints a;
    std::memcpy(&a, p, sizeof a);
    return a;
}
VKT_HD void store(float* p, Floats a) { std::memcpy(p, &a, sizeof a); }
VKT_HD void store(double* p, Doubles a) { std::memcpy(p, &a, sizeof a); }
VKT_HD void store(std::int32_t* p, Ints a) { std::memcpy(p, &a, sizeof a); }
/// Half a register of floats at p as doubles, and a register of them from doubles at p.
VKT_HD Doubles doubles_of(float const* p) {
    using Half = float __attribute__((vector_size(2 * wide)));
    Half a;
    std::memcpy(&a, p, sizeof a);
    return __builtin_convertvector(a, Doubles);
}
VKT_HD Floats floats_of(double const* p) {
    using Both = double __attribute__((vector_size(8 * wide)));
    Both a;
    std::memcpy(&a, p, sizeof a);
    return __builtin_convertvector(a, Floats);
}
/// From here on an array is read from memory: compilers take its numbers out of the registers that they were stored
/// from, one by one, which takes longer.
template <class T, std::size_t n> VKT_HD void keep_in_memory(T (&numbers)[n]) { asm("" : "+m"(numbers)); }
VKT_HD Floats select(Ints first, Floats a, Floats b) { return first ? a : b; }
VKT_HD Floats square_root(Floats a) {
#if defined(__AVX512F__)
    return _mm512_sqrt_ps(a);
#elif defined(__AVX2__)
    return _mm256_sqrt_ps(a);
#else
    for (int i = 0; i < wide; ++i) a[i] = std::sqrt(a[i]);
    return a;
#endif
}
VKT_HD Ints whole(Floats a) { return __builtin_convertvector(a, Ints); }
VKT_HD Floats real(Ints a) { return __builtin_convertvector(a, Floats); }

/// The lanes of b one further, behind the last one of a; the same of groups of four.
VKT_HD Floats behind(Floats a, Floats b) {
#if defined(__AVX512F__)
    return __builtin_shufflevector(a, b, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30);
#elif defined(__AVX2__)
    return __builtin_shufflevector(a, b, 7, 8, 9, 10, 11, 12, 13, 14);
#else
    return __builtin_shufflevector(a, b, 3, 4, 5, 6);
#endif
}
VKT_HD Floats quad_behind(Floats a, [[maybe_unused]] Floats b) {
#if defined(__AVX512F__)
    return __builtin_shufflevector(a, b, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27);
#elif defined(__AVX2__)
    return __builtin_shufflevector(a, b, 4, 5, 6, 7, 8, 9, 10, 11);
#else
    return a;
#endif
}

/// Groups of four from items[at[0]], items[at[1]], …, as many as there is room for.
VKT_HD Floats quads_at(Quad const* items, std::int32_t const* at) {
#if defined(__AVX512F__)
    __m512 const two = _mm512_insertf32x4(_mm512_castps128_ps512(items[at[0]]), items[at[1]], 1);
    return _mm512_insertf32x4(_mm512_insertf32x4(two, items[at[2]], 2), items[at[3]], 3);
#elif defined(__AVX2__)
    return _mm256_insertf128_ps(_mm256_castps128_ps256(items[at[0]]), items[at[1]], 1);
#else
    return items[at[0]];
#endif
}
/// Four numbers of each lane of the quarter q of a.
template <int q, class V> VKT_HD V spread(V a) {
#if defined(__AVX512F__)
    constexpr int i = 4 * q;
    return __builtin_shufflevector(a, a, i, i, i, i, i + 1, i + 1, i + 1, i + 1, i + 2, i + 2, i + 2, i + 2, i + 3,
                                   i + 3, i + 3, i + 3);
#elif defined(__AVX2__)
    constexpr int i = 2 * q;
    return __builtin_shufflevector(a, a, i, i, i, i, i + 1, i + 1, i + 1, i + 1);
#else
    return __builtin_shufflevector(a, a, q, q, q, q);
#endif
}
/// The first number of each group.
VKT_HD Floats firsts(Floats a, Floats b, Floats c, Floats d) {
#if defined(__AVX512F__)
    Floats const low = __builtin_shufflevector(a, b, 0, 4, 8, 12, 16, 20, 24, 28, 0, 4, 8, 12, 16, 20, 24, 28);
    Floats const high = __builtin_shufflevector(c, d, 0, 4, 8, 12, 16, 20, 24, 28, 0, 4, 8, 12, 16, 20, 24, 28);
    return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 24, 25, 26, 27, 28, 29, 30, 31);
#elif defined(__AVX2__)
    Floats const low = __builtin_shufflevector(a, b, 0, 4, 8, 12, 0, 4, 8, 12);
    Floats const high = __builtin_shufflevector(c, d, 0, 4, 8, 12, 0, 4, 8, 12);
    return __builtin_shufflevector(low, high, 0, 1, 2, 3, 12, 13, 14, 15);
#else
    return __builtin_shufflevector(__builtin_shufflevector(a, b, 0, 4, 0, 4), __builtin_shufflevector(c, d, 0, 4, 0, 4),
                                   0, 1, 4, 5);
#endif
}
/// A group of four in every place; the last one.
VKT_HD Floats spread_of(Quad q) {
#if defined(__AVX512F__)
    return _mm512_broadcast_f32x4(q);
#elif defined(__AVX2__)
    return _mm256_insertf128_ps(_mm256_castps128_ps256(q), q, 1);
#else
    return q;
#endif
}
VKT_HD Quad last_quad(Floats a) {
    Quad q;
    std::memcpy(&q, reinterpret_cast<char const*>(&a) + sizeof a - 16, 16);
    return q;
}
VKT_HD bool any_of(Ints mask) {
    std::uint64_t words[sizeof mask / 8], some = 0;
    std::memcpy(words, &mask, sizeof mask);
    for (std::uint64_t const w : words) some |= w;
    return some != 0;
}

} // namespace vkt::render
