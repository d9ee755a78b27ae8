// VTK's XML image files (.vti) and their parts: what the XML says, found by expat.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/io/byte_source.h"

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// One DataArray of a piece.
struct VtiArray {
    std::string name;
    DataType type = DataType::float32;
    std::int64_t components = 1;
    bool cells = false; ///< of cells, not of points
    enum class Format : std::uint8_t { ascii, binary, appended } format = Format::ascii;
    std::int64_t begin = 0, end = 0; ///< inline: bytes of the file; appended: begin is the offset
};

struct VtiPiece {
    std::array<std::int64_t, 6> extent{};
    std::vector<VtiArray> arrays;
    std::string source; ///< .pvti: the file
};

/// What the XML says.
struct VtiStructure {
    std::string name; ///< of the file, for messages
    bool parallel = false;
    std::array<std::int64_t, 6> whole{};
    Geometry geometry; ///< of point 0,0,0
    bool big_endian = false, wide_header = false;
    enum class Compressor : std::uint8_t { none, zlib, lz4, lzma } compressor = Compressor::none;
    std::vector<VtiPiece> pieces;
    std::vector<VtiArray> declared;          ///< .pvti: what every piece has
    std::string active_points, active_cells; ///< names of the arrays that count as "the" scalars
    std::vector<std::string> not_read;       ///< arrays of types that no voxel has
    std::int64_t appended = -1;              ///< where appended data begin
    bool appended_base64 = false;
    std::optional<Header> ours; ///< what vkt wrote
};

/// True for the beginning of a VTK XML file of images, whole or in parts.
bool is_vti(std::string_view head);

/// Parses the file up to its appended data. Throws Error{data} for what is no image file, or damaged.
VtiStructure read_vti_structure(ByteSource& bytes);

} // namespace vkt
