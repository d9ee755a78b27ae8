// XXH3-64, the checksum of streams, in the registers of the processor.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/backend.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace vkt {

// Compiled for the least processor, as xxHash in a header would be, it takes as long as copying what it is of: with
// AVX2 a third of that, with AVX-512 a fifth.

VKT_CPU_KERNEL(hash_bytes,
               (std::span<std::byte const> data, std::uint64_t seed, std::uint64_t& result, Execution const& execution),
               (data, seed, result, execution))
/// The next bytes of a hash whose `state` is an XXH3_state_t, which is the same in all back ends.
VKT_CPU_KERNEL(hash_more, (std::span<std::byte const> data, void* state, Execution const& execution),
               (data, state, execution))

} // namespace vkt
