// The source behind every format whose voxels lie in files in order, x fastest: regions, byte order, several files.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/components.h"
#include "libvkt/formats/decode.h"
#include "libvkt/formats/format.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Where the voxels of one or several equal volumes lie.
struct RawLayout {
    Header header;            ///< of every volume
    std::int64_t volumes = 1; ///< that follow one another
    std::optional<SequenceAxis> sequence;
    /// The volumes are as many such series one after another; attribute "channel" says which one is meant.
    std::int64_t channels = 1;
    Components components; ///< of each voxel, which become volumes of their own
    Encoding encoding = Encoding::raw;
    bool big_endian = false; ///< no meaning for text
    /// Files that hold equal shares, in order; empty if the voxels are in the file that was opened, at its position.
    std::vector<std::string> files;
    std::int64_t line_skip = 0; ///< lines before the voxels of each file, of the encoded file
    /// Bytes before the voxels of each file, of the decoded file; -1 (not for hex and text): the voxels are the file's
    /// last bytes. Files that are compressed are decoded twice then, since only their end tells where that is.
    std::int64_t byte_skip = 0;
    bool exact = false;                ///< bytes behind the last voxel are an error
    std::vector<std::string> not_read; ///< what else the file holds, for people
    /// Told of bytes behind the last voxel, in one line, where they are no error: of the file that was opened, and of
    /// those whose encoding says where they end.
    std::function<void(std::string const&)> notice;
};

/// Access::random if everything is a regular file of encoding raw, reading only the bytes that a region needs, or if
/// voxels have several components; otherwise Access::forward. Sizes are checked against the files before next_volume()
/// returns. Throws Error{data, io}.
std::unique_ptr<Source> raw_source(std::unique_ptr<ByteSource> bytes, RawLayout layout);

/// Reverses the bytes of n samples of `size` bytes each, in place.
void swap_bytes(std::byte* data, std::size_t n, std::size_t size);

/// What a symbolic link leads to; empty of other files, and if that is not there.
std::string where_linked(std::string const& path);

/// `file`, which a header names, as seen from the header's directory: of a link from that of what it leads to, if the
/// file is there, or else its own. Headers come from anywhere, and what they name is
/// read: unless they are `trusted`, Error{data} is thrown for absolute names, for those that leave that directory (also
/// through symbolic links), and for what is there but is no regular file.
std::string beside(std::string const& header_name, std::string const& file, bool trusted);

} // namespace vkt
