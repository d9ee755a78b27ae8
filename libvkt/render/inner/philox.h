// Counter-based random numbers: Philox4x32-10 (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3").
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/host_device.h"

#include <cstdint>

namespace vkt::render {

struct PhiloxBlock {
    std::uint32_t word[4];
};

VKT_HD PhiloxBlock philox(PhiloxBlock c, std::uint32_t key0, std::uint32_t key1) {
    for (int round = 0; round < 10; ++round) {
        std::uint64_t const a = std::uint64_t{0xD2511F53U} * c.word[0], b = std::uint64_t{0xCD9E8D57U} * c.word[2];
        c = {{static_cast<std::uint32_t>(b >> 32) ^ c.word[1] ^ key0, static_cast<std::uint32_t>(b),
              static_cast<std::uint32_t>(a >> 32) ^ c.word[3] ^ key1, static_cast<std::uint32_t>(a)}};
        key0 += 0x9E3779B9U;
        key1 += 0xBB67AE85U;
    }
    return c;
}

/// The numbers of one path: a function of seed, pixel, sample and how many were drawn before, and of nothing else.
struct Random {
    std::uint32_t key0, key1, pixel, sample, drawn = 0;
    PhiloxBlock block{};

    VKT_HD Random(std::uint64_t seed, std::uint32_t pixel_index, std::uint32_t sample_index)
        : key0(static_cast<std::uint32_t>(seed)), key1(static_cast<std::uint32_t>(seed >> 32)), pixel(pixel_index),
          sample(sample_index) {}
    /// Uniform in [0, 1): multiples of 2^-24, so that 1 - x is never 0.
    VKT_HD float next() {
        if (drawn % 4 == 0) block = philox({{drawn / 4, sample, pixel, 0}}, key0, key1);
        std::uint32_t const at = drawn++ % 4;
        // Chosen, not indexed: that is how a GPU keeps them in registers.
        std::uint32_t const low = at == 0 ? block.word[0] : block.word[1],
                            high = at == 2 ? block.word[2] : block.word[3];
        return static_cast<float>((at < 2 ? low : high) >> 8) * 0x1p-24F;
    }
};

} // namespace vkt::render
