// Set bits of a word, on CPUs and on GPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/backend.h"

#include <cstdint>

namespace vkt::VKT_BACKEND {

/// How many there are.
VKT_HD int set_bits(std::uint64_t word) { return __builtin_popcountll(word); }

/// The place of the lowest of a word that has one.
VKT_HD int lowest_bit(std::uint64_t word) {
#ifdef __CUDA_ARCH__
    return __ffsll(static_cast<long long>(word)) - 1;
#else
    return __builtin_ctzll(word);
#endif
}

} // namespace vkt::VKT_BACKEND
