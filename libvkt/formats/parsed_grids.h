// Structured volumes read by a child: what readers with foreign libraries implement, how they answer, and the source
// as the process that asks sees it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/parser_child.h"

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace vkt {

/// What one opening of a file yields: equal volumes one after another.
struct ParsedGrids {
    Header header;            ///< of every volume
    std::int64_t volumes = 1; ///< that follow one another
    /// What is said of single volumes besides ("channel", "sequence position"); empty, or as many as there are volumes.
    std::vector<std::map<std::string, std::string>> attributes;
    /// Variables of which nobody chose one, with a word about each: the header is that of the first.
    std::vector<std::pair<std::string, std::string>> choices;
    std::vector<std::string> not_read; ///< what else there is
    /// Where the slices of all volumes begin in the file, if they lie there dense, x fastest: who asked reads them then
    /// without the library. Otherwise empty.
    std::vector<std::int64_t> places;
    /// Where the chunks of all volumes begin, if the voxels lie there as they are: those along x first, then y, z and
    /// the volumes. Each has the extent `chunk`, at the ends of the volume too. Otherwise empty.
    std::vector<std::int64_t> chunk_places;
    Index3 chunk{1, 1, 1};
    bool big_endian = false; ///< voxels at `places` and `chunk_places`
    /// Slices that are read most cheaply together, at least 1.
    std::int64_t slab = 1;
};

/// What of a file is wanted, and how.
struct GridsChoice {
    std::string variable;              ///< may be empty
    bool force_uniform = false;        ///< as of ReadOptions
    bool personal = false;             ///< as of ReadOptions
    bool trust_paths = false;          ///< as of ReadOptions
    std::vector<std::string> together; ///< as of ReadOptions
};

/// The reader of an open file; runs in a child and may crash.
class GridsParser {
public:
    virtual ~GridsParser() = default;
    /// Throws Error.
    virtual ParsedGrids open(GridsChoice const& choice) = 0;
    /// Copies the voxels of the box of one volume, dense, x fastest, in this machine's byte order.
    virtual void read(std::int64_t volume, Box const& box, std::byte* to) = 0;
};

/// Requests have these numbers, so that a module may answer about trees (parsed_tree.h) as well.
inline constexpr std::int64_t open_grids_request = 100, read_grids_request = 101;

/// The child's side; the reader is made at the first request.
ParserHandler answer_about_grids(std::function<std::unique_ptr<GridsParser>()> make);

/// The volumes of a file or directory, read by a child in which `module` is loaded; `what` cannot be done without it.
/// Voxels come through shared memory of which one half is filled while the other is copied, or straight from the file.
/// Access::random. `bytes` must be seekable or a directory, whose files are as large as `size` together.
std::unique_ptr<Source> parsed_grids(std::string module, std::string what, std::shared_ptr<ByteSource const> bytes,
                                     std::int64_t size, ReadOptions const& options);

/// The same bytes in a form that can be read anywhere: what comes from a pipe or a decoder is copied to a nameless file
/// in the directory for temporary files. Throws Error{io}.
std::unique_ptr<ByteSource> seekable_bytes(std::unique_ptr<ByteSource> bytes);

} // namespace vkt
