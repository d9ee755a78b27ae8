// OpenEXR pictures: named planes of floats in linear light, and texts.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace vkt {

/// Planes of the same size. Where it is a part of a larger picture, its first pixel is at (x, y) there.
struct FloatPicture {
    struct Plane {
        std::string name;          ///< as the format has it: "R", "Z", "normal.X"
        std::vector<float> values; ///< width * height, row by row from the top
        bool half = false;         ///< kept in 16 bits
    };
    int width = 0, height = 0;
    int x = 0, y = 0, whole_width = 0, whole_height = 0; ///< 0: it is the whole picture
    std::vector<Plane> planes;
    std::vector<std::pair<std::string, std::string>> texts; ///< attributes that are strings

    Plane const* find(std::string_view name) const;
};

/// Throws Error{failure} if the build is without OpenEXR, naming `what` cannot be done.
void require_exr(std::string const& what);

/// The bytes of a file: scan lines, ZIP, the display window is the whole picture. The same picture gives the same
/// bytes. Throws Error{failure} without OpenEXR.
std::vector<std::byte> exr_bytes(FloatPicture const& picture, std::string const& what);

bool is_exr(std::span<std::byte const> head);
/// Reads a file to its end: scan lines or tiles, the first part. Throws Error{data} for what is damaged, deep,
/// subsampled or larger than 16384 pixels each way, Error{failure} without OpenEXR.
FloatPicture read_exr(ByteSource& bytes);

/// What the module openexr hands to the library.
struct ExrFunctions {
    std::vector<std::byte> (*encode)(FloatPicture const& picture);
    FloatPicture (*decode)(std::span<std::byte const> file, std::string const& name);
};

} // namespace vkt
