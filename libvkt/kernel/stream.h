// Stores that bypass the caches, for outputs too large to be read again from them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/backend.h"

#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace vkt::VKT_BACKEND {

/// Outputs from this size on are written around the caches; smaller ones are likely to be read by the next stage.
inline constexpr std::size_t stream_threshold = std::size_t{24} << 20;

/// Copies n bytes with non-temporal stores. Every thread that used it must call stream_fence() before others read.
inline void stream_bytes(std::byte* to, std::byte const* from, std::size_t n) {
#if defined(__x86_64__)
    std::size_t const head = (64 - reinterpret_cast<std::uintptr_t>(to) % 64) % 64;
    if (n < head + 64) {
        std::memcpy(to, from, n);
        return;
    }
    std::memcpy(to, from, head);
    std::size_t i = head;
    for (; i + 64 <= n; i += 64) {
#if defined(__AVX512F__)
        _mm512_stream_si512(reinterpret_cast<__m512i*>(to + i), _mm512_loadu_si512(from + i));
#elif defined(__AVX__)
        __m256i const a = _mm256_loadu_si256(reinterpret_cast<__m256i const*>(from + i));
        __m256i const b = _mm256_loadu_si256(reinterpret_cast<__m256i const*>(from + i + 32));
        _mm256_stream_si256(reinterpret_cast<__m256i*>(to + i), a);
        _mm256_stream_si256(reinterpret_cast<__m256i*>(to + i + 32), b);
#else
        for (std::size_t j = i; j < i + 64; j += 16)
            _mm_stream_si128(reinterpret_cast<__m128i*>(to + j),
                             _mm_loadu_si128(reinterpret_cast<__m128i const*>(from + j)));
#endif
    }
    std::memcpy(to + i, from + i, n - i);
#else
    std::memcpy(to, from, n);
#endif
}

/// A register of U, as wide as the instruction set has them.
template <class U> struct Register {
    typedef U type __attribute__((vector_size(register_bytes)));
    static constexpr std::int64_t lanes = static_cast<std::int64_t>(register_bytes / sizeof(U));
};

/// Stores a register past the caches; `to` is aligned to its size.
template <class U> VKT_HD void stream_register(U* to, typename Register<U>::type value) {
#if defined(__AVX512F__)
    _mm512_stream_si512(reinterpret_cast<__m512i*>(to), reinterpret_cast<__m512i>(value));
#elif defined(__AVX2__)
    _mm256_stream_si256(reinterpret_cast<__m256i*>(to), reinterpret_cast<__m256i>(value));
#elif defined(__x86_64__)
    _mm_stream_si128(reinterpret_cast<__m128i*>(to), reinterpret_cast<__m128i>(value));
#else
    std::memcpy(to, &value, sizeof value);
#endif
}

inline void stream_fence() {
#if defined(__x86_64__)
    _mm_sfence();
#endif
}

} // namespace vkt::VKT_BACKEND
