// FrameReader: the frames of a stream one after the other, each verified, and the header of the volume they belong to.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/channel.h"
#include "ipc/input.h"
#include "ipc/stream.h"
#include "libvkt/core/header.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace vkt::ipc {

/// Whatever is damaged, missing or out of place is Error{data}; an ERR frame is an UpstreamError.
class FrameReader {
public:
    /// The options must outlive it.
    FrameReader(std::unique_ptr<ByteSource> bytes, StreamOptions const& options);

    /// Reads up to the header of the next volume; false where the stream ends as it should. Voxels of a volume before
    /// must have been read.
    bool next_volume();
    Header const& header() const { return header_; }
    /// The side channel to the writer; null if there is none.
    std::shared_ptr<ConsumerChannel> const& channel() const { return channel_; }

    /// The next frame that this version knows, up to its payload; false for END, which is compared with what was read.
    bool next(FrameHeader& frame);
    /// Part of a payload that is no voxels.
    void read(void* to, std::size_t n);
    void read_voxels(std::byte* to, std::size_t n);
    /// Voxels that nobody will look at: their length counts, their bytes are not even copied.
    void skip_voxels(std::size_t n);
    /// Voxels of this frame that lie in shared memory, which belong to the volume like those in the pipe.
    void count_voxels(std::size_t n) { voxel_bytes_ += n; }
    /// Compares the payload's hash with the frame's, if it has one.
    void verify(FrameHeader const& frame, std::uint64_t computed) const;
    /// A frame was read to its end: for the comparison with END.
    void count(FrameHeader const& frame);

    /// Where the voxels in a slot of shared memory lie.
    std::byte const* shared_slot(std::uint32_t slot, std::size_t bytes) const;
    std::string const& name() const { return input_.name(); }
    /// Makes a read that waits in another thread throw Cancelled.
    void cancel() const { input_.cancel(); }
    /// Up to date after note_traffic().
    std::shared_ptr<StreamRecord const> record() const { return record_; }
    void note_traffic(double waited) { record_->traffic = {waited, input_.taken()}; }

private:
    [[noreturn]] void ended_early() const;
    FrameHeader read_header();
    std::string read_text(FrameHeader const& frame, char const* what);
    [[noreturn]] void pass_on_error(FrameHeader const& frame);
    void check_end(FrameHeader const& frame);

    StreamOptions const& options_;
    Input input_;
    std::shared_ptr<ConsumerChannel> channel_;
    Header header_;
    bool any_volume_ = false, in_volume_ = false;
    std::uint64_t frames_ = 0, voxel_bytes_ = 0, chain_ = 0;
    bool all_checked_ = true;
    std::shared_ptr<StreamRecord> record_ = std::make_shared<StreamRecord>();
};

} // namespace vkt::ipc
