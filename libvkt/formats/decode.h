// Bytes one after the other, decoded on the way in bounded memory: plain, deflate, bzip2, hexadecimal, decimal text.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/formats/format.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace vkt {

/// How voxels lie in a file. `deflate` is gzip (any number of members) or zlib, told apart by their first bytes.
enum class Encoding : std::uint8_t { raw, deflate, bzip2, hex, text };

/// A sequence of bytes that can only be read forward.
class ByteStream {
public:
    virtual ~ByteStream() = default;
    /// Up to n bytes; fewer only at the end. Throws Error{data} on damage, also where a checksum at the end fails.
    virtual std::size_t read(std::byte* to, std::size_t n) = 0;
};

/// Decodes what is left of `bytes` (which must outlive the result). Text becomes samples of `type` in the byte order of
/// this machine: blanks and commas separate; integers must be in the type's range. Throws Error{data} when bzip2 is not
/// built in.
std::unique_ptr<ByteStream> decode(ByteSource& bytes, Encoding encoding, DataType type);

/// True if these are the first bytes of a gzip file.
bool is_gzip(std::span<std::byte const> head);
/// What the beginning of a gzip file stands for: up to n bytes, fewer where it ends or is damaged.
std::vector<std::byte> decoded_head(std::span<std::byte const> head, std::size_t n);
/// The content of a gzip file under the same name, to be read in order.
std::unique_ptr<ByteSource> gunzip(std::unique_ptr<ByteSource> bytes);

/// Least number of file bytes that can hold n decoded ones: what header sizes are checked against before anyone
/// allocates.
std::int64_t least_encoded_bytes(Encoding encoding, std::int64_t n, DataType type);

} // namespace vkt
