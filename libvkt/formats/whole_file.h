// Small files that are held in memory as a whole: pictures.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/byte_source.h"

#include <cstddef>
#include <vector>

namespace vkt {

/// Of a picture's file: 16384 x 16384 pixels of four floats.
inline constexpr std::size_t most_picture_bytes = std::size_t{4} << 30;
/// Pixels of a picture that is read, each way.
inline constexpr int most_picture_side = 16384;

/// What is left of the bytes. Throws Error{data} if that is more than `most`.
inline std::vector<std::byte> whole_file(ByteSource& bytes, std::size_t most) {
    std::vector<std::byte> all;
    for (;;) {
        constexpr std::size_t piece = std::size_t{1} << 20;
        std::size_t const had = all.size();
        all.resize(had + piece);
        std::size_t const n = bytes.read(all.data() + had, piece);
        all.resize(had + n);
        if (n == 0) return all;
        if (all.size() > most)
            throw Error(ErrorKind::data, text("'", bytes.name(), "' is larger than a picture may be"));
    }
}

} // namespace vkt
