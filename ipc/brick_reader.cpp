// Tables of bricks, as records or as packed numbers, and their cells across frames, in pipes or in shared memory.
// SPDX-License-Identifier: MIT
#include "ipc/brick_reader.h"

#include "libvkt/amr/tree.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/source.h"

#include <algorithm>
#include <cstring>

namespace vkt::ipc {
namespace {

constexpr std::size_t least_group = std::size_t{256} << 10; ///< bytes of cells that are handed out at once, at least
constexpr std::uint64_t most_records = 4096;                ///< of a frame, of which each is read at once

} // namespace

BrickReader::BrickReader(FrameReader& frames, std::size_t group_bytes)
    : frames_(frames), header_(frames.header()),
      group_bytes_(std::min(brick_group_bytes, std::max(group_bytes, least_group))) {}

/// The frame that comes next is one of bricks, from this one on; returns how many, and what is left of its payload.
BricksHeader BrickReader::read_head(FrameHeader const& frame, FrameType type, std::size_t first) {
    if (frame.type != type)
        throw Error(ErrorKind::data,
                    frame.type == FrameType::slab ? text("slabs in the hierarchical volume on ", frames_.name())
                    : type == FrameType::tree
                        ? text("the cells on ", frames_.name(), " come before the table of bricks")
                        : text("bricks on ", frames_.name(), " are out of order"),
                    type == FrameType::tree ? "older versions of vkt wrote no table: make the volume again" : "");
    BricksHeader head;
    if (frame.length < sizeof head)
        throw Error(ErrorKind::data, text("a brick frame on ", frames_.name(), " has no header"));
    frames_.read(&head, sizeof head);
    if (head.first != first || head.count == 0 || head.count > static_cast<std::uint64_t>(header_.brick_count) - first)
        throw Error(ErrorKind::data, text("bricks on ", frames_.name(), " are out of order"));
    return head;
}

/// The table of bricks, which grows with what arrives: the stated count allocates nothing.
void BrickReader::read_table() {
    if (header_.dry_run) throw PlannedOnly();
    if (table_) return;
    if (header_.brick_count < 0 || header_.brick_count > (std::int64_t{1} << 32))
        throw Error(ErrorKind::data, text("the brick count on ", frames_.name(), " is impossible"));
    FrameHeader frame;
    if (header_.brick_count > 0) next_frame(frame);
    table_ = frame.type == FrameType::packed ? read_numbers(frame) : read_records(frame);
    next_brick_ = framed_bricks_ = 0;
    frame_left_ = 0;
}

/// What is behind the head of a frame of the table.
std::vector<std::byte> BrickReader::read_table_frame(FrameHeader const& frame, FrameType type, std::size_t first,
                                                     std::size_t& count_of_bricks) {
    BricksHeader const head = read_head(frame, type, first);
    if (head.count > most_records || frame.length > sizeof head + most_records * sizeof(BrickRecord)) refuse_size();
    std::vector<std::byte> payload(frame.length - sizeof head);
    frames_.read(payload.data(), payload.size());
    if ((frame.flags & flag_checksum) != 0)
        frames_.verify(frame, hash(payload, hash(std::as_bytes(std::span(&head, 1)))));
    frames_.count(frame);
    count_of_bricks = head.count;
    return payload;
}

BrickTable BrickReader::read_records(FrameHeader frame) {
    std::vector<Brick> bricks;
    std::int64_t cells_left = header_.cell_count;
    while (static_cast<std::int64_t>(bricks.size()) < header_.brick_count) {
        if (!bricks.empty()) next_frame(frame);
        std::size_t count_here = 0;
        std::vector<std::byte> const payload = read_table_frame(frame, FrameType::tree, bricks.size(), count_here);
        if (payload.size() != count_here * sizeof(BrickRecord)) refuse_size();
        for (std::size_t i = 0; i < count_here; ++i) {
            BrickRecord r;
            std::memcpy(&r, payload.data() + i * sizeof r, sizeof r);
            Brick const brick{{r.lower[0], r.lower[1], r.lower[2]}, {r.dims[0], r.dims[1], r.dims[2]}, r.level};
            if (r.dims[0] < 1 || r.dims[1] < 1 || r.dims[2] < 1 || r.level < 0 || r.level >= header_.level_count ||
                static_cast<double>(r.dims[0]) * r.dims[1] * r.dims[2] > static_cast<double>(cells_left))
                throw Error(ErrorKind::data, text("a brick on ", frames_.name(), " is impossible"));
            cells_left -= brick.cells();
            bricks.push_back(brick);
        }
    }
    if (cells_left != 0) throw Error(ErrorKind::data, text("bricks are missing on ", frames_.name()));
    return {header_.dims, std::move(bricks)};
}

BrickTable BrickReader::read_numbers(FrameHeader frame) {
    std::vector<std::uint32_t> words;
    std::optional<BrickPacking> packing;
    for (std::size_t bricks = 0; static_cast<std::int64_t>(bricks) < header_.brick_count;) {
        if (packing) next_frame(frame);
        std::size_t count_here = 0;
        std::vector<std::byte> const payload = read_table_frame(frame, FrameType::packed, bricks, count_here);
        PackingRecord record;
        if (payload.size() < sizeof record) refuse_size();
        std::memcpy(&record, payload.data(), sizeof record);
        auto const stated = BrickPacking::of_record(record, header_);
        if (!stated || (packing && *packing != *stated))
            throw Error(ErrorKind::data, text("the table on ", frames_.name(), " is packed in an impossible way"));
        packing = stated;
        std::size_t const bytes = count_here * record.words * sizeof(std::uint32_t), before = words.size();
        if (payload.size() != sizeof record + bytes) refuse_size();
        words.resize(before + bytes / sizeof(std::uint32_t));
        std::memcpy(words.data() + before, payload.data() + sizeof record, bytes);
        bricks += count_here;
    }
    try {
        return table_of_numbers(*packing, std::move(words), header_);
    } catch (Error const& error) {
        throw Error(error.kind(), text("the table on ", frames_.name(), ": ", error.what()));
    }
}

void BrickReader::next_frame(FrameHeader& frame) {
    if (!frames_.next(frame)) throw Error(ErrorKind::data, text("bricks are missing on ", frames_.name()));
}

void BrickReader::refuse_size() const {
    throw Error(ErrorKind::data, text("a brick frame on ", frames_.name(), " has the wrong size"));
}

/// Begins the next frame of cells.
void BrickReader::open_frame() {
    next_frame(frame_);
    BricksHeader const head = read_head(frame_, FrameType::bricks, framed_bricks_);
    frame_left_ = cell_bytes(framed_bricks_, head.count);
    framed_bricks_ += head.count;
    bool const is_shared = (frame_.flags & flag_shared) != 0;
    if (frame_.length != sizeof head + (is_shared ? sizeof(SharedCells) : frame_left_)) refuse_size();
    shared_cells_ = nullptr;
    if (is_shared) {
        SharedCells shared;
        frames_.read(&shared, sizeof shared);
        shared_cells_ = frames_.shared_slot(shared.slot, frame_left_);
        shared_name_ = shared.slot;
    }
    frame_hash_ = std::make_unique<StreamHash>(hash(std::as_bytes(std::span(&head, 1))));
}

/// The frame of cells was read to its end.
void BrickReader::close_frame() {
    if (shared_cells_ != nullptr) frames_.channel()->give_back(shared_name_);
    if ((frame_.flags & flag_checksum) != 0) frames_.verify(frame_, frame_hash_->value());
    frames_.count(frame_);
}

/// The next n bytes of cells, across frames.
void BrickReader::take_cells(std::byte* to, std::size_t n) {
    while (n > 0) {
        if (frame_left_ == 0) open_frame();
        std::size_t const step = std::min(n, frame_left_);
        if (shared_cells_ != nullptr) {
            std::memcpy(to, shared_cells_, step);
            shared_cells_ += step;
            frames_.count_voxels(step);
        } else {
            frames_.read_voxels(to, step);
        }
        if ((frame_.flags & flag_checksum) != 0) frame_hash_->add({to, step});
        frame_left_ -= step;
        to += step;
        n -= step;
        if (frame_left_ == 0) close_frame();
    }
}

/// Reads up to a brick; nobody wants the cells, but they are verified.
void BrickReader::pass(std::size_t end) {
    std::vector<std::byte> passed(std::min(cell_bytes(next_brick_, end - next_brick_), std::size_t{256} << 10));
    for (std::size_t left = cell_bytes(next_brick_, end - next_brick_); left > 0;) {
        std::size_t const step = std::min(left, passed.size());
        take_cells(passed.data(), step);
        left -= step;
    }
    next_brick_ = end;
}

std::size_t BrickReader::cell_bytes(std::size_t first, std::size_t count) const {
    return static_cast<std::size_t>(table_->cells(first, count)) * size_of(header_.dtype);
}

BrickSequence BrickReader::take() {
    read_table();
    BrickSequence sequence(
        header_, *table_,
        [this](std::size_t first, std::size_t count, std::byte* to) {
            if (first < next_brick_) throw Error(ErrorKind::failure, "bricks of a stream were asked for out of order");
            pass(first);
            take_cells(to, cell_bytes(first, count));
            next_brick_ = first + count;
        },
        BrickOrder::ascending);
    sequence.set_group_bytes(group_bytes_);
    return sequence;
}

void BrickReader::finish() {
    read_table();
    pass(table_->size());
    FrameHeader frame;
    if (frames_.next(frame)) throw Error(ErrorKind::data, text("there are more cells than bricks on ", frames_.name()));
}

} // namespace vkt::ipc
