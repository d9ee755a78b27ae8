// The random numbers of paths: counters that name the path and what was drawn.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/philox.h"

#include <cstdint>

namespace vkt::render {

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
