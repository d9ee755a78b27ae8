// xxHash, whose functions stay in this file.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace vkt::VKT_BACKEND {

void hash_bytes(std::span<std::byte const> data, std::uint64_t seed, std::uint64_t& result, Execution const&) {
    result = XXH3_64bits_withSeed(data.data(), data.size(), seed);
}

void hash_more(std::span<std::byte const> data, void* state, Execution const&) {
    XXH3_64bits_update(static_cast<XXH3_state_t*>(state), data.data(), data.size());
}

} // namespace vkt::VKT_BACKEND
