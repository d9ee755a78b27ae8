// VTK's XML image files (.vti) and their parts: what the XML says, found by expat, and the bytes of arrays, which lie
// inline or appended, in base64 or raw, compressed in blocks or not.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/io/byte_source.h"

#include <array>
#include <cstdint>
#include <memory>
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

/// The decoded bytes of one array.
class VtiData {
public:
    /// `size` is how many bytes it must have. The structure and the bytes must live as long. Throws Error{data} where
    /// the array states another size.
    VtiData(ByteSource const& bytes, VtiStructure const& structure, VtiArray const& array, std::int64_t size);
    ~VtiData();
    VtiData(VtiData const&) = delete;
    VtiData& operator=(VtiData const&) = delete;

    /// Copies the bytes [position, position + n), in this machine's byte order.
    void read(std::int64_t position, std::byte* to, std::int64_t n);

private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

} // namespace vkt
