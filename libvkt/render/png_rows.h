// The rows of a PNG file, packed strip by strip, by several threads.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace vkt::render {

struct PngRows {
    int height;
    std::size_t row_bytes, pixel_bytes;
    std::function<void(int row, unsigned char* to)> fill; ///< called by several threads
};

/// What the IDAT chunks hold, in their order. The same whatever the threads. `level` is that of zlib. A strip that is
/// the same as the one before is packed once.
std::vector<std::vector<unsigned char>> packed_rows(PngRows const& rows, int level, int threads);

} // namespace vkt::render
