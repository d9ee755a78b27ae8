// Radiance pictures (.hdr): red, green and blue of 8 bits with a common exponent, read only.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"

#include <cstddef>
#include <span>
#include <vector>

namespace vkt {

struct RadiancePicture {
    int width = 0, height = 0;
    std::vector<float> values; ///< 3 * width * height, linear, row by row from the top
};

bool is_radiance(std::span<std::byte const> head);
/// Reads a file to its end: run lengths of either kind or none, rows from the top (Ward, Real Pixels, Graphics Gems II,
/// 1991). An exposure that the header tells is undone. Throws Error{data} for what is damaged, turned, in XYZ or larger
/// than 16384 pixels each way.
RadiancePicture read_radiance(ByteSource& bytes);

} // namespace vkt
