// Deflate compression on the way to a file, on several threads, with the same bytes for any number of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace vkt {

/// What so many bytes take at least: deflate makes no more than 258 bytes of 2 bits.
constexpr std::size_t least_deflated(std::size_t bytes) { return bytes / 1032; }

/// Writes one gzip member (RFC 1952), zlib stream (RFC 1950), or bare deflate (RFC 1951), as in a member of a ZIP file.
/// The input is cut into blocks of fixed size, each compressed on its own with the 32 KiB before it as dictionary and
/// joined on byte boundaries, so that the bytes depend neither on the sizes of write() nor on the number of threads.
/// Each thread holds about a MiB.
class DeflateWriter {
public:
    enum class Wrapper : std::uint8_t { gzip, zlib, none };

    /// Uses as many threads as the options allow and an eighth of their budget has room for, but at least one. `start`:
    /// where in the file it begins.
    DeflateWriter(OutputFile& file, Wrapper wrapper, WriteOptions const& options, std::int64_t start = 0);
    void write(std::byte const* data, std::size_t n);
    /// The first bytes of all (not zlib; once, before write()), not compressed: restore() can still replace them.
    void store(std::string_view head);
    /// Other bytes of the same number in place of what store() was given, in a file that is not in place.
    void restore(std::string_view head);
    void finish();                                          ///< writes what is held and the checksum
    std::int64_t bytes_written() const { return written_; } ///< compressed, wrapper included
    /// After finish(): of all that went in, CRC-32 but for zlib.
    unsigned long checksum() const { return checksum_; }

private:
    void compress(bool last);
    void put(void const* data, std::size_t n);

    OutputFile& file_;
    Wrapper wrapper_;
    std::int64_t start_;
    int threads_;
    std::vector<std::byte> held_; ///< dictionary_ bytes that are written already, then whole and partial blocks
    std::size_t dictionary_ = 0;
    unsigned long checksum_;
    std::size_t stored_ = 0;
    unsigned long stored_checksum_ = 0;
    std::uint64_t read_ = 0;
    std::int64_t written_ = 0;
};

} // namespace vkt
