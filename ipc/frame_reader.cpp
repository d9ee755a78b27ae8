// Frames of a stream, verified; nothing that one of them states is believed before it has come.
// SPDX-License-Identifier: MIT
#include "ipc/frame_reader.h"

#include "ipc/descriptor.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/stream_reader.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace vkt::ipc {
namespace {

static_assert(stream_magic_bytes == magic.size());
constexpr std::size_t largest_text = std::size_t{256} << 20; ///< JSON payloads beyond this are refused

} // namespace

bool is_stream(std::span<std::byte const> head) {
    auto const digit = head.size() < magic.size() ? '\0' : static_cast<char>(head[3]);
    return digit >= '0' && digit <= '9' && std::memcmp(head.data(), magic.data(), 3) == 0;
}

FrameReader::FrameReader(std::unique_ptr<ByteSource> bytes, StreamOptions const& options)
    : options_(options), input_(std::move(bytes), options.waiting) {}

void FrameReader::ended_early() const {
    double const total = static_cast<double>(header_.bytes());
    double const got = static_cast<double>(voxel_bytes_);
    std::string const lacks = got < total ? text(bytes_text(got), " of ", bytes_text(total)) : "its end is missing";
    throw Error(ErrorKind::data,
                in_volume_ ? text("the volume on ", name(), " ended early: ", lacks)
                           : text("the stream on ", name(), " ended early, within its header"),
                input_.is_file() ? "the file was cut off, or the command that wrote it failed"
                                 : "an upstream command failed");
}

void FrameReader::read(void* to, std::size_t n) {
    if (input_.read(to, n) != n) ended_early();
}

void FrameReader::read_voxels(std::byte* to, std::size_t n) {
    std::size_t const got = input_.read(to, n);
    voxel_bytes_ += got;
    if (got != n) ended_early();
}

void FrameReader::skip_voxels(std::size_t n) {
    std::size_t const got = input_.discard(n);
    voxel_bytes_ += got;
    if (got != n) ended_early();
}

FrameHeader FrameReader::read_header() {
    FrameHeader frame;
    read(&frame, sizeof frame);
    if (!intact(frame)) throw Error(ErrorKind::data, text("a frame header on ", name(), " is damaged (checksum)"));
    return frame;
}

std::string FrameReader::read_text(FrameHeader const& frame, char const* what) {
    if (frame.length > largest_text)
        throw Error(ErrorKind::data, text("the ", what, " frame on ", name(), " is too large"));
    std::string payload;
    // Grows with what arrives: the stated length allocates nothing.
    while (payload.size() < frame.length) {
        std::size_t const step = std::min<std::size_t>(frame.length - payload.size(), std::size_t{1} << 20);
        std::size_t const old = payload.size();
        payload.resize(old + step);
        read(payload.data() + old, step);
    }
    verify(frame, (frame.flags & flag_checksum) != 0 ? hash(std::as_bytes(std::span(payload))) : 0);
    return payload;
}

void FrameReader::verify(FrameHeader const& frame, std::uint64_t computed) const {
    if ((frame.flags & flag_checksum) != 0 && computed != frame.checksum)
        throw Error(ErrorKind::data, text("data on ", name(), " is damaged (checksum)"));
}

void FrameReader::count(FrameHeader const& frame) {
    if ((frame.flags & flag_checksum) == 0) all_checked_ = false;
    ++frames_;
    chain_ = hash(std::as_bytes(std::span(&frame.checksum, 1)), chain_);
}

void FrameReader::pass_on_error(FrameHeader const& frame) {
    ErrorReport const error = error_from_json(read_text(frame, "ERR"));
    // Of a file nobody else says what was wrong.
    if (input_.is_file())
        throw Error(ErrorKind::data, text(name(), " ends with the error of the command that wrote it: ", error.stage,
                                          ": ", printable(error.message)));
    throw UpstreamError(text(error.stage, ": ", error.message));
}

bool FrameReader::next(FrameHeader& frame) {
    while (true) {
        frame = read_header();
        switch (frame.type) {
        case FrameType::slab:
        case FrameType::tree:
        case FrameType::packed:
        case FrameType::bricks:
            return true;
        case FrameType::end:
            check_end(frame);
            return false;
        case FrameType::error:
            pass_on_error(frame);
        default:
            if ((frame.flags & flag_required) != 0)
                throw Error(ErrorKind::data, text("the stream on ", name(), " needs a newer vkt (unknown frame)"));
            if (input_.discard(frame.length) != frame.length) ended_early();
        }
    }
}

void FrameReader::check_end(FrameHeader const& frame) {
    EndReport report = end_from_json(read_text(frame, "END"));
    std::uint64_t const expected = header_.dry_run ? 0 : header_.bytes();
    if (report.bytes != voxel_bytes_ || report.frames != frames_ || voxel_bytes_ != expected)
        throw Error(ErrorKind::data,
                    text("the volume on ", name(), " is incomplete: ", bytes_text(static_cast<double>(voxel_bytes_)),
                         " of ", bytes_text(static_cast<double>(expected))));
    if (report.checksum != 0 && all_checked_ && report.checksum != chain_)
        throw Error(ErrorKind::data, text("the volume on ", name(), " is damaged (checksum over all slabs)"));
    record_->stages = std::move(report.stages);
    in_volume_ = false;
}

bool FrameReader::next_volume() {
    std::array<char, 8> start{};
    std::size_t const got = input_.read(start.data(), start.size());
    if (got == 0 && any_volume_) return false;
    if (got == 0) refuse_empty(name(), input_.descriptor());
    if (got < start.size() && std::memcmp(start.data(), magic.data(), got) == 0) ended_early();
    if (start != magic) {
        if (std::memcmp(start.data(), magic.data(), 4) == 0)
            throw Error(ErrorKind::data, text("the stream on ", name(), " was damaged on its way"),
                        "transfer it as binary data, not as text");
        if (std::memcmp(start.data(), magic.data(), 3) == 0)
            throw Error(ErrorKind::data, text("the stream on ", name(), " has another version"),
                        "read it with the vkt that wrote it, and write it in another format");
        throw Error(ErrorKind::data, text("what follows on ", name(), " is no volume stream"));
    }
    FrameHeader const frame = read_header();
    if (frame.type == FrameType::error) pass_on_error(frame);
    if (frame.type != FrameType::header)
        throw Error(ErrorKind::data, text("the stream on ", name(), " does not begin with a header"));
    header_ = header_from_json(read_text(frame, "HEAD"));
    // Only now is it certain that the producer is a vkt process and listens.
    if (!channel_ && is_pipe(input_.descriptor()))
        channel_ = std::make_shared<ConsumerChannel>(input_.descriptor(), options_.whole, options_.gpu);
    any_volume_ = in_volume_ = true;
    frames_ = voxel_bytes_ = chain_ = 0;
    all_checked_ = true;
    return true;
}

std::byte const* FrameReader::shared_slot(std::uint32_t slot, std::size_t bytes) const {
    if (!channel_)
        throw Error(ErrorKind::data, text("voxels on ", name(), " lie in shared memory of another pipeline"));
    return channel_->slot(slot, bytes);
}

} // namespace vkt::ipc
