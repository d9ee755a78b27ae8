// Keeping a whole volume so that it can be read again in any order: memory up to a limit, an unlinked file beyond.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/source.h"

namespace vkt {

/// Serves a volume that was put into it with random access. The file has no name from the start, so nothing remains
/// whatever happens to the process. Disk full is Error{io}.
class Spool {
public:
    /// Keeps volumes of up to `in_memory` bytes in memory: in that of the current GPU if `space` asks for it and there
    /// is room.
    Spool(Header const& header, std::size_t in_memory, Execution const& execution, StageInfo const& info,
          Space space = Space::host);
    ~Spool();
    Spool(Spool const&) = delete;
    Spool& operator=(Spool const&) = delete;

    /// Takes the current volume of a source, piece by piece.
    void fill(Source& source, Execution const& execution);
    /// Where to put these voxels before store() takes them.
    AnyView place(Box const& box);
    /// The same with what was stored there, to be changed.
    AnyView take(Box const& box);
    void store(ConstView voxels);

    void read(AnyView out);
    std::optional<ConstView> borrow(Box const& region) const;
    Space space() const { return voxels_.space; } ///< where borrow() hands them out

private:
    explicit Spool(Header const& header) : header_(header) {} ///< what throws after it finds the file closed
    void open_file(std::string const& directory);
    std::byte* memory_on_gpu();
    std::int64_t offset_of(std::int64_t y, std::int64_t z) const;
    void write(std::byte const* data, std::size_t n, std::int64_t offset);
    void fetch(std::byte* to, std::size_t n, std::int64_t offset);

    Header header_;
    Buffer memory_;
    AnyView voxels_;
    Buffer scratch_, staging_;
    int file_ = -1;
    std::string directory_;
};

/// Cells of a hierarchical volume, in a file from the start: put there and read in any order.
class BrickSpool {
public:
    BrickSpool(Header const& tree, BrickTable bricks, Execution const& execution, StageInfo const& info);
    void store(std::size_t first, std::size_t count, std::byte const* cells);
    void read(std::size_t first, std::size_t count, std::byte* to);

private:
    Box place_of(std::size_t first, std::size_t count) const;

    DataType type_;
    BrickTable bricks_;
    Spool file_;
};

/// The same bricks, which may be asked for in any order: as they are if they may be already, else read to their end and
/// kept, in memory up to so many bytes, and in a file beyond.
BrickSequence spooled(BrickSequence bricks, std::size_t in_memory, Execution const& execution, StageInfo const& info);

/// The current volume of a source, which is finished thereby, as one that can be read in any order; finishing that does
/// nothing. It takes up to a share of the memory for one of so many inputs, and a file beyond.
std::unique_ptr<Source> spooled(Source& source, std::size_t inputs, Execution const& execution, StageInfo const& info);

} // namespace vkt
