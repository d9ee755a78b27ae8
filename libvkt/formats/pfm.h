// PFM pictures: one or three planes of float32 without a range, rows from below.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"

#include <cstddef>
#include <span>
#include <vector>

namespace vkt {

struct PfmPicture {
    int width = 0, height = 0;
    int channels = 3;          ///< 3 (red, green, blue, "PF") or 1 ("Pf")
    std::vector<float> values; ///< row by row from the top, channels side by side
};

/// Little-endian, as the negative scale in its third line says.
std::vector<std::byte> pfm_bytes(PfmPicture const& picture);

bool is_pfm(std::span<std::byte const> head);
/// Reads a file to its end, of either byte order; the scale but for its sign is not applied. Throws Error{data}.
PfmPicture read_pfm(ByteSource& bytes);

} // namespace vkt
