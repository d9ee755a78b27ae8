// What the module blosc hands to the library: its two functions, which many threads may call at once.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/module.h"

#include <cstddef>

namespace vkt {

struct BloscFunctions {
    /// False unless the bytes stand for exactly m bytes.
    bool (*decompress)(std::byte const* from, std::size_t n, std::byte* to, std::size_t m);
    /// Bytes written, at most n + 16, which is what `to` must have room for; 0 on failure.
    std::size_t (*compress)(std::byte const* from, std::size_t n, std::size_t element, std::byte* to);
};

} // namespace vkt
