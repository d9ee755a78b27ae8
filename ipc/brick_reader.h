// BrickReader: a hierarchical volume out of the frames of a stream, its table of bricks first, then their cells.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/frame_reader.h"
#include "libvkt/core/brick_sequence.h"
#include "libvkt/core/brick_table.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace vkt::ipc {

class BrickReader {
public:
    /// Of the volume whose header was read last.
    BrickReader(FrameReader& frames, std::size_t group_bytes);

    /// The bricks, once, in the order they come in; cells that are not asked for are verified all the same. The reader
    /// must outlive it. Throws Error{data}; PlannedOnly in a dry run.
    BrickSequence take();
    /// Reads what is left of the volume, and its end.
    void finish();

private:
    void read_table();
    BricksHeader read_head(FrameHeader const& frame, FrameType type, std::size_t first);
    std::vector<std::byte> read_table_frame(FrameHeader const& frame, FrameType type, std::size_t first,
                                            std::size_t& count_of_bricks);
    BrickTable read_records(FrameHeader frame);
    BrickTable read_numbers(FrameHeader frame);
    void next_frame(FrameHeader& frame);
    [[noreturn]] void refuse_size() const;
    void open_frame();
    void close_frame();
    void take_cells(std::byte* to, std::size_t n);
    void pass(std::size_t end);
    std::size_t cell_bytes(std::size_t first, std::size_t count) const;

    FrameReader& frames_;
    Header const& header_;
    std::size_t group_bytes_;
    std::optional<BrickTable> table_;                ///< once it was read
    std::size_t next_brick_ = 0, framed_bricks_ = 0; ///< the next to hand out, and behind the frame under way
    FrameHeader frame_;                              ///< the frame under way,
    std::size_t frame_left_ = 0;                     ///< what is left of its cells,
    std::unique_ptr<StreamHash> frame_hash_;         ///< the hash of those before,
    std::byte const* shared_cells_ = nullptr;        ///< where they lie in shared memory,
    std::uint32_t shared_name_ = 0;                  ///< and in which slot
};

} // namespace vkt::ipc
