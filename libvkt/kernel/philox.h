// Counter-based random numbers: Philox4x32-10 (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3").
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/host_device.h"

#include <cstdint>

namespace vkt {

struct PhiloxBlock {
    std::uint32_t word[4];
};

/// The random words of a counter.
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

} // namespace vkt
