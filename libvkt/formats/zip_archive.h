// ZIP files as NumPy and Zarr write them: members stored or deflated, found by the directory at the end.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"
#include "libvkt/io/output_file.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <zlib.h>

namespace vkt {

/// What the records of a ZIP file begin with, their sizes, and numbers in them.
namespace zip {
inline constexpr std::string_view local_mark{"PK\3\4", 4}, central_mark{"PK\1\2", 4}, end_mark{"PK\5\6", 4},
    end64_mark{"PK\6\6", 4}, locator_mark{"PK\6\7", 4};
inline constexpr std::size_t local_size = 30, central_size = 46, end_size = 22, end64_size = 56, locator_size = 20;
inline constexpr std::uint64_t in_extra = 0xffffffff; ///< a number of 32 bits that stands among those of 64
inline constexpr std::uint16_t numbers64 = 1;         ///< these, among the extra fields
inline constexpr int stored = 0, deflated = 8;        ///< methods
} // namespace zip

struct ZipMember {
    std::string name;
    int method = zip::stored;
    bool encrypted = false;
    std::uint64_t checksum = 0, packed = 0, bytes = 0, at = 0;
};

/// The directory of a seekable file. Throws Error{data} for what is no whole ZIP file.
std::vector<ZipMember> zip_members(ByteSource const& bytes);
/// Where the member's bytes begin, `packed` of them. Throws Error{data}, also for other methods and encryption.
std::int64_t zip_begin(ByteSource const& bytes, ZipMember const& member);
/// Name of the first member of a file that begins like this; empty if it is no ZIP file or the name is cut off.
std::string zip_first_name(std::span<std::byte const> head);

/// What follows the directory of so many members, which has that length and begins at `at`.
std::string zip_end(std::uint64_t count, std::uint64_t length, std::uint64_t at);

/// Members with numbers of 64 bits and no times, so that equal stores are equal files.
class ZipWriter {
public:
    /// `file` can be written to again.
    explicit ZipWriter(OutputFile& file) : file_(file) {}
    /// The whole of a file, stored as it is under this name.
    void add(std::string const& name, ByteSource& bytes);
    /// A member of another archive, packed as it is there. Throws Error{data} for what zip_begin() refuses.
    void copy(ByteSource const& archive, ZipMember member);
    /// A member whose bytes the caller writes to the file, from the position on that is returned.
    std::int64_t begin(std::string const& name, int method);
    /// After the last of them.
    void end(std::uint64_t bytes, std::uint64_t packed, std::uint64_t checksum);
    /// The directory. Nothing is added afterwards.
    void finish();

private:
    void put(std::string const& bytes);

    OutputFile& file_;
    std::uint64_t at_ = 0;
    std::vector<ZipMember> members_;
};

/// The bytes of a deflated member, in order. Throws Error{data} where they are not what was stored.
class Inflated {
public:
    /// `at`: where its bytes begin.
    Inflated(std::shared_ptr<ByteSource const> bytes, std::int64_t at, ZipMember member);
    ~Inflated();
    Inflated(Inflated const&) = delete;
    Inflated& operator=(Inflated const&) = delete;
    /// Up to n bytes, fewer at the end.
    std::size_t read(std::byte* to, std::size_t n);

private:
    [[noreturn]] void damaged() const;
    void fill();

    std::shared_ptr<ByteSource const> bytes_;
    ZipMember member_;
    std::int64_t at_;
    std::uint64_t left_, count_ = 0;
    std::vector<Bytef> input_;
    z_stream state_{};
    unsigned long checksum_ = 0;
    bool ended_ = false;
};

} // namespace vkt
