// Bytes that were compressed at once (a chunk, a block of an array), unpacked into memory of the size that they had.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace vkt {

/// deflate: behind the header of zlib or of gzip. lz4: a block, whose size stands elsewhere. lzma: .xz or .lzma.
enum class Packing : std::uint8_t { deflate, zstd, lz4, bzip2, lzma };

/// Whether this build has the library for it.
bool can_unpack(Packing packing);
/// Throws Error{failure}, which names the file and what to build with, unless can_unpack().
void require(Packing packing, std::string const& file);
/// False for what is damaged, becomes more or less than there is room for, or needs a library that this build lacks.
bool unpack(Packing packing, std::span<std::byte const> from, std::span<std::byte> to);
/// How many bytes they become, at most as many as there is room for; none where unpack() is false. Of lz4 too.
std::optional<std::size_t> unpack_some(Packing packing, std::span<std::byte const> from, std::span<std::byte> to);

} // namespace vkt
