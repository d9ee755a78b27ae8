// The reading end: parses frames, verifies them, reads ahead on a thread into a small ring of reused slabs. Slabs in
// shared memory need no thread: the writer fills them ahead of us, and only their frames are read.
// SPDX-License-Identifier: MIT
#include "ipc/channel.h"
#include "ipc/descriptor.h"
#include "ipc/input.h"
#include "ipc/stream.h"

#include "libvkt/amr/tree.h"
#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/formats/stream_reader.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace vkt::ipc {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t ring_slabs = 2;
/// Slabs beyond this are handed out slice by slice, so that no frame decides how much memory a reader needs.
constexpr std::size_t piece_bytes = std::size_t{2} << 20;
constexpr std::size_t least_group = std::size_t{256} << 10;  ///< bytes of cells that are handed out at once, at least
constexpr std::uint64_t most_records = 4096;                 ///< of a frame, of which each is read at once
constexpr std::size_t largest_text = std::size_t{256} << 20; ///< JSON payloads beyond this are refused

struct Piece {
    Box box;
    Buffer voxels;
    std::byte const* shared = nullptr;  ///< where they lie in shared memory,
    Space space = Space::host;          ///< which may be a GPU's
    std::shared_ptr<SlotLease> lease{}; ///< that keeps them there
};

[[maybe_unused]] bool const registered = [] {
    set_stream_reader({magic.size(), is_stream, [](std::unique_ptr<ByteSource> bytes) -> std::unique_ptr<Source> {
                           return std::make_unique<StreamSource>(std::move(bytes), StreamOptions{});
                       }});
    return true;
}();

} // namespace

bool is_stream(std::span<std::byte const> head) {
    auto const digit = head.size() < magic.size() ? '\0' : static_cast<char>(head[3]);
    return digit >= '0' && digit <= '9' && std::memcmp(head.data(), magic.data(), 3) == 0;
}

class StreamSource::Reader {
public:
    Reader(std::unique_ptr<ByteSource> bytes, StreamOptions options)
        : input_(std::move(bytes), options.waiting), options_(std::move(options)) {}
    ~Reader() {
        stop();
        note_traffic();
    }
    Reader(Reader const&) = delete;
    Reader& operator=(Reader const&) = delete;

    bool next_volume();
    Header const& header() const { return header_; }
    void read(AnyView out);
    std::optional<ConstView> borrow(Box const& region);
    std::shared_ptr<Lease> lease(Box const& region);
    void expect(Box const& region) { expected_ = region; }
    std::int64_t first_slab_height();
    Space space();
    void finish();
    BrickSequence take_bricks();
    std::optional<Volume> take_whole();
    std::shared_ptr<StreamRecord const> record() const { return record_; }

private:
    void note_traffic() { record_->traffic = {wait_, input_.taken()}; }
    [[noreturn]] void ended_early();
    FrameHeader read_frame_header();
    std::string read_text(FrameHeader const& frame, char const* what);
    void verify(FrameHeader const& frame, std::uint64_t computed) const;
    bool next_frame(FrameHeader& frame);
    bool peek_slab();
    SlabHead read_slab_head(FrameHeader const& frame);
    Cut pieces_of(Box const& slab) const;
    void read_slabs();
    bool read_slab();
    void count(FrameHeader const& frame);
    bool wanted(Box const& slab) const;
    void check_end(FrameHeader const& frame);
    void start();
    /// Until something has changed, or for a while.
    void wait_for_thread(std::unique_lock<std::mutex>& lock);
    void stop();
    Box box_of_slab(SlabHead const& head) const;
    bool is_passed(Box const& piece, Index3 at) const;
    bool is_released(Index3 at) const { return at.z < released_.z || (at.z == released_.z && at.y < released_.y); }
    Piece* piece_with(Index3 at);
    void hand_out(Piece piece);
    Piece empty_piece();
    void release_front();
    std::byte const* shared_slot(std::uint32_t name, std::size_t bytes);
    void read_shared(SlabHead const& head);
    void receive();
    BricksHeader read_bricks_head(FrameHeader const& frame, FrameType type, std::size_t first);
    void read_table();
    std::vector<std::byte> read_table_frame(FrameHeader const& frame, FrameType type, std::size_t first,
                                            std::size_t& count_of_bricks);
    BrickTable read_records(FrameHeader frame);
    BrickTable read_numbers(FrameHeader frame);
    [[noreturn]] void refuse_size() const;
    void open_bricks();
    void close_bricks();
    void take_cells(std::byte* to, std::size_t n);
    void pass_bricks(std::size_t end);
    void finish_bricks();
    std::size_t cell_bytes(std::size_t first, std::size_t count) const;
    std::size_t slice_bytes() const {
        return static_cast<std::size_t>(header_.dims.x * header_.dims.y) * size_of(header_.dtype);
    }
    ConstView view_of(Piece& piece) const {
        return dense_view(piece.shared != nullptr ? piece.shared : piece.voxels.read(Space::host), header_.dtype,
                          piece.box, piece.space);
    }

    Input input_;
    StreamOptions options_;
    std::shared_ptr<ConsumerChannel> channel_;
    Header header_;
    bool any_volume_ = false, in_volume_ = false;
    Box expected_;
    std::optional<FrameHeader> pending_; ///< first frame, read to learn the slab height
    std::optional<SlabHead> pending_slab_;
    PieceOrder order_; ///< of the slabs
    std::uint64_t frames_ = 0, bytes_ = 0, chain_ = 0;
    bool all_checked_ = true;
    std::optional<std::uint32_t> segment_; ///< that take_whole() hands out
    std::uint64_t segment_bytes_ = 0;
    std::optional<Space> space_; ///< of the first slab, once that is known

    std::optional<BrickTable> table_;                ///< of a hierarchical volume, once it was read
    std::size_t next_brick_ = 0, framed_bricks_ = 0; ///< the next to hand out, and behind the frame under way
    FrameHeader brick_frame_;                        ///< the frame under way,
    std::size_t frame_left_ = 0;                     ///< what is left of its cells,
    std::unique_ptr<StreamHash> frame_hash_;         ///< the hash of those before,
    std::byte const* shared_cells_ = nullptr;        ///< where they lie in shared memory,
    std::uint32_t shared_name_ = 0;                  ///< and in which slot
    double wait_ = 0;
    std::shared_ptr<StreamRecord> record_ = std::make_shared<StreamRecord>();

    std::thread thread_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Piece> ready_;
    std::vector<Piece> spare_;
    Index3 released_; ///< what lies before this row is gone
    bool complete_ = false, cancel_ = false;
    std::exception_ptr failure_;
};

void StreamSource::Reader::ended_early() {
    double const total = static_cast<double>(header_.bytes());
    double const got = static_cast<double>(bytes_);
    throw Error(
        ErrorKind::data,
        in_volume_ ? text("the volume on ", input_.name(), " ended early: ", bytes_text(got), " of ", bytes_text(total))
                   : text("the stream on ", input_.name(), " ended early, within its header"),
        "an upstream command failed or the file was cut off");
}

FrameHeader StreamSource::Reader::read_frame_header() {
    FrameHeader frame;
    if (input_.read(&frame, sizeof frame) != sizeof frame) ended_early();
    if (!intact(frame))
        throw Error(ErrorKind::data, text("a frame header on ", input_.name(), " is damaged (checksum)"));
    return frame;
}

std::string StreamSource::Reader::read_text(FrameHeader const& frame, char const* what) {
    if (frame.length > largest_text)
        throw Error(ErrorKind::data, text("the ", what, " frame on ", input_.name(), " is too large"));
    std::string payload;
    // Grows with what arrives: the stated length allocates nothing.
    while (payload.size() < frame.length) {
        std::size_t const step = std::min<std::size_t>(frame.length - payload.size(), std::size_t{1} << 20);
        std::size_t const old = payload.size();
        payload.resize(old + step);
        if (input_.read(payload.data() + old, step) != step) ended_early();
    }
    verify(frame, (frame.flags & flag_checksum) != 0 ? hash(std::as_bytes(std::span(payload))) : 0);
    return payload;
}

void StreamSource::Reader::verify(FrameHeader const& frame, std::uint64_t computed) const {
    if ((frame.flags & flag_checksum) != 0 && computed != frame.checksum)
        throw Error(ErrorKind::data, text("data on ", input_.name(), " is damaged (checksum)"));
}

/// The next frame that this version knows; false for END (already checked).
bool StreamSource::Reader::next_frame(FrameHeader& frame) {
    while (true) {
        frame = read_frame_header();
        switch (frame.type) {
        case FrameType::slab:
        case FrameType::tree:
        case FrameType::packed:
        case FrameType::bricks:
            return true;
        case FrameType::end:
            check_end(frame);
            return false;
        case FrameType::error: {
            ErrorReport const error = error_from_json(read_text(frame, "ERR"));
            throw UpstreamError(text(error.stage, ": ", error.message));
        }
        default:
            if ((frame.flags & flag_required) != 0)
                throw Error(ErrorKind::data,
                            text("the stream on ", input_.name(), " needs a newer vkt (unknown frame)"));
            if (input_.discard(frame.length) != frame.length) ended_early();
        }
    }
}

void StreamSource::Reader::check_end(FrameHeader const& frame) {
    EndReport report = end_from_json(read_text(frame, "END"));
    std::uint64_t const expected = header_.dry_run ? 0 : header_.bytes();
    if (report.bytes != bytes_ || report.frames != frames_ || bytes_ != expected)
        throw Error(ErrorKind::data,
                    text("the volume on ", input_.name(), " is incomplete: ", bytes_text(static_cast<double>(bytes_)),
                         " of ", bytes_text(static_cast<double>(expected))));
    if (report.checksum != 0 && all_checked_ && report.checksum != chain_)
        throw Error(ErrorKind::data, text("the volume on ", input_.name(), " is damaged (checksum over all slabs)"));
    record_->stages = std::move(report.stages);
}

bool StreamSource::Reader::next_volume() {
    if (in_volume_) finish();
    note_traffic();
    std::array<char, 8> start{};
    std::size_t const got = input_.read(start.data(), start.size());
    if (got == 0 && any_volume_) return false;
    if (got == 0)
        throw Error(ErrorKind::data, text("no volume on ", input_.name(), ": it is empty"),
                    "an upstream command failed before it wrote anything");
    if (got < start.size() && std::memcmp(start.data(), magic.data(), got) == 0) ended_early();
    if (start != magic) {
        if (std::memcmp(start.data(), magic.data(), 4) == 0)
            throw Error(ErrorKind::data, text("the stream on ", input_.name(), " was damaged on its way"),
                        "transfer it as binary data, not as text");
        if (std::memcmp(start.data(), magic.data(), 3) == 0)
            throw Error(ErrorKind::data, text("the stream on ", input_.name(), " has another version"),
                        "read it with the vkt that wrote it, and write it in another format");
        throw Error(ErrorKind::data, text("what follows on ", input_.name(), " is no volume stream"));
    }
    FrameHeader const frame = read_frame_header();
    if (frame.type == FrameType::error) {
        ErrorReport const error = error_from_json(read_text(frame, "ERR"));
        throw UpstreamError(text(error.stage, ": ", error.message));
    }
    if (frame.type != FrameType::header)
        throw Error(ErrorKind::data, text("the stream on ", input_.name(), " does not begin with a header"));
    header_ = header_from_json(read_text(frame, "HEAD"));
    // Only now is it certain that the producer is a vkt process and listens.
    if (!channel_ && is_pipe(input_.descriptor()))
        channel_ = std::make_shared<ConsumerChannel>(input_.descriptor(), options_.whole, options_.gpu);
    any_volume_ = in_volume_ = true;
    complete_ = false;
    frames_ = bytes_ = chain_ = 0;
    all_checked_ = true;
    order_ = PieceOrder(header_.dims);
    released_ = {};
    expected_ = box_of(header_.dims);
    pending_.reset();
    pending_slab_.reset();
    table_.reset();
    space_.reset();
    return true;
}

Box StreamSource::Reader::box_of_slab(SlabHead const& head) const {
    return {{0, head.rows.y_begin, head.slab.z_begin}, {header_.dims.x, head.rows.y_end, head.slab.z_end}};
}

SlabHead StreamSource::Reader::read_slab_head(FrameHeader const& frame) {
    SlabHead head;
    SlabHeader const& slab = head.slab;
    bool const rows = (frame.flags & flag_rows) != 0;
    std::size_t const bytes = head.bytes(rows).size();
    if (frame.length < bytes) throw Error(ErrorKind::data, text("a slab on ", input_.name(), " has no header"));
    if (input_.read(&head, bytes) != bytes) ended_early();
    if (!rows) head.rows = {0, header_.dims.y};
    Box const box = box_of_slab(head);
    // Extents only once the order has shown them to be within the volume: nothing is multiplied before.
    if (!order_.takes(box) || slab.bytes != static_cast<std::uint64_t>(box.voxels()) * size_of(header_.dtype) ||
        frame.length != bytes + (slab.place == Residence::here ? slab.bytes : 0) ||
        (slab.place != Residence::here && slab.place != Residence::shared && slab.place != Residence::segment))
        throw Error(ErrorKind::data, text("a slab on ", input_.name(), " is out of order or of the wrong size"));
    return head;
}

/// How the voxels of a slab are handed out.
Cut StreamSource::Reader::pieces_of(Box const& slab) const {
    std::size_t const slice = slice_bytes(), row = slice / static_cast<std::size_t>(header_.dims.y);
    std::size_t const limit = std::max(options_.piece, piece_bytes);
    if (slice > limit) return {1, static_cast<std::int64_t>(std::max<std::size_t>(1, limit / row))};
    bool const large = static_cast<std::size_t>(slab.dims().z) * slice > 2 * piece_bytes;
    return {large ? static_cast<std::int64_t>(std::max<std::size_t>(1, piece_bytes / slice)) : slab.dims().z,
            header_.dims.y};
}

/// Reads the frame of the next slab, up to its voxels; false if there is none.
bool StreamSource::Reader::peek_slab() {
    if (pending_slab_) return true;
    FrameHeader frame;
    if (!next_frame(frame)) return false;
    if (frame.type != FrameType::slab)
        throw Error(ErrorKind::data, text("bricks in the structured volume on ", input_.name()));
    pending_slab_ = read_slab_head(frame);
    pending_ = frame;
    return true;
}

std::int64_t StreamSource::Reader::first_slab_height() {
    if (thread_.joinable() || complete_ || header_.dry_run || header_.kind != Kind::structured) return 0;
    if (!peek_slab()) throw Error(ErrorKind::data, text("the volume on ", input_.name(), " has no slabs"));
    Box const slab = box_of_slab(*pending_slab_);
    return pending_slab_->slab.place != Residence::here ? slab.dims().z
                                                        : std::min(slab.dims().z, pieces_of(slab).slices);
}

Space StreamSource::Reader::space() {
    if (!options_.gpu || header_.dry_run || header_.kind != Kind::structured) return Space::host;
    if (!space_) {
        bool const shared = first_slab_height() > 0 && pending_slab_->slab.place == Residence::shared;
        if (shared) (void)shared_slot(pending_slab_->slab.slot, pending_slab_->slab.bytes);
        space_ = shared ? channel_->memory_of(pending_slab_->slab.slot)->space() : Space::host;
    }
    return *space_;
}

void StreamSource::Reader::start() {
    if (thread_.joinable() || complete_) return;
    thread_ = std::thread([this] {
        try {
            read_slabs();
        } catch (...) {
            std::lock_guard const lock(mutex_);
            failure_ = std::current_exception();
        }
        std::lock_guard const lock(mutex_);
        complete_ = true;
        changed_.notify_all();
    });
}

void StreamSource::Reader::stop() {
    if (!thread_.joinable()) return;
    {
        std::lock_guard const lock(mutex_);
        cancel_ = true;
        changed_.notify_all();
    }
    input_.cancel(); // it may sit in read(2) for as long as upstream pleases
    thread_.join();
    cancel_ = false;
}

void StreamSource::Reader::read_slabs() {
    while (!cancel_ && read_slab()) {
    }
}

bool StreamSource::Reader::wanted(Box const& slab) const {
    return slab.upper.z > expected_.lower.z && slab.lower.z < expected_.upper.z && !expected_.empty();
}

Piece StreamSource::Reader::empty_piece() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return cancel_ || ready_.size() < ring_slabs; });
    Piece piece;
    if (cancel_) throw Cancelled{};
    if (!spare_.empty()) {
        piece = std::move(spare_.back());
        spare_.pop_back();
    }
    return piece;
}

void StreamSource::Reader::hand_out(Piece piece) {
    std::lock_guard const lock(mutex_);
    ready_.push_back(std::move(piece));
    changed_.notify_all();
}

/// Under the lock: the first piece is no longer needed.
void StreamSource::Reader::release_front() {
    Piece& piece = ready_.front();
    bool const rows = piece.box.upper.y < header_.dims.y;
    released_ = {0, rows ? piece.box.upper.y : 0, rows ? piece.box.lower.z : piece.box.upper.z};
    if (piece.shared == nullptr) spare_.push_back(std::move(piece));
    ready_.pop_front();
    changed_.notify_all();
}

std::byte const* StreamSource::Reader::shared_slot(std::uint32_t name, std::size_t bytes) {
    if (!channel_)
        throw Error(ErrorKind::data, text("voxels on ", input_.name(), " lie in shared memory of another pipeline"));
    return channel_->slot(name, bytes);
}

void StreamSource::Reader::read_shared(SlabHead const& head) {
    SlabHeader const& slab = head.slab;
    Piece piece;
    piece.box = box_of_slab(head);
    if (slab.place == Residence::segment) {
        if (slab.slot == segment_) segment_bytes_ += slab.bytes;
        std::size_t const slice = slice_bytes(), row = slice / static_cast<std::size_t>(header_.dims.y);
        piece.shared = shared_slot(slab.slot, header_.bytes()) + static_cast<std::size_t>(piece.box.lower.z) * slice +
                       static_cast<std::size_t>(piece.box.lower.y) * row;
    } else {
        piece.shared = shared_slot(slab.slot, slab.bytes);
        piece.lease = std::make_shared<SlotLease>(channel_, slab.slot, slab.bytes);
        piece.space = piece.lease->ring()->space();
    }
    if (wanted(piece.box)) hand_out(std::move(piece));
    bytes_ += slab.bytes;
}

/// For the comparison with END, a frame that was read.
void StreamSource::Reader::count(FrameHeader const& frame) {
    if ((frame.flags & flag_checksum) == 0) all_checked_ = false;
    ++frames_;
    chain_ = hash(std::as_bytes(std::span(&frame.checksum, 1)), chain_);
}

/// Reads the next slab, wherever it lies; false if there is none.
bool StreamSource::Reader::read_slab() {
    if (!peek_slab()) return false;
    FrameHeader const frame = *pending_;
    SlabHead const head = *pending_slab_;
    SlabHeader const& slab = head.slab;
    Box const box = box_of_slab(head);
    pending_.reset();
    pending_slab_.reset();
    bool const check = (frame.flags & flag_checksum) != 0;
    if (slab.place != Residence::here) {
        read_shared(head);
    } else if (!wanted(box)) {
        // Nobody will look at these voxels: their length counts, their bytes are not even copied.
        std::size_t const got = input_.discard(slab.bytes);
        bytes_ += got;
        if (got != slab.bytes) ended_early();
    } else {
        StreamHash hasher(hash(head.bytes((frame.flags & flag_rows) != 0)));
        Cut const cut = pieces_of(box);
        for_each_part(box, [&](Box const& rest) {
            Piece piece = empty_piece();
            piece.box = rest;
            piece.box.upper.z = std::min(rest.lower.z + cut.slices, rest.upper.z);
            piece.box.upper.y = std::min(rest.lower.y + cut.rows, rest.upper.y);
            Box const part = piece.box;
            std::size_t const bytes = static_cast<std::size_t>(piece.box.voxels()) * size_of(header_.dtype);
            piece.voxels.reserve(bytes);
            std::byte* const target = piece.voxels.write(Space::host);
            // Hashed while it is still in the cache.
            constexpr std::size_t step = std::size_t{1} << 18;
            for (std::size_t done = 0; done < bytes; done += step) {
                std::size_t const n = std::min(step, bytes - done);
                std::size_t const got = input_.read(target + done, n);
                bytes_ += got;
                if (got != n) ended_early();
                if (check) hasher.add({target + done, n});
            }
            hand_out(std::move(piece));
            return part;
        });
        verify(frame, check ? hasher.value() : 0);
    }
    count(frame);
    order_.advance(box);
    return true;
}

/// True if a piece ends before a row.
bool StreamSource::Reader::is_passed(Box const& piece, Index3 at) const {
    bool const rows = piece.upper.y < header_.dims.y; // the next piece has others of this slice
    return piece.upper.z <= at.z || (rows && piece.lower.z == at.z && piece.upper.y <= at.y);
}

void StreamSource::Reader::wait_for_thread(std::unique_lock<std::mutex>& lock) {
    if (!options_.waiting) return changed_.wait(lock);
    if (changed_.wait_for(lock, waiting_pause) == std::cv_status::no_timeout) return;
    lock.unlock();
    options_.waiting();
    lock.lock();
}

/// The piece that holds a row, waiting for it; releases those before.
Piece* StreamSource::Reader::piece_with(Index3 at) {
    if (header_.dry_run) throw PlannedOnly();
    std::unique_lock lock(mutex_);
    while (true) {
        while (!ready_.empty() && is_passed(ready_.front().box, at)) release_front();
        for (auto& piece : ready_) {
            bool const begun = piece.box.lower.z < at.z || (piece.box.lower.z == at.z && piece.box.lower.y <= at.y);
            if (begun && !is_passed(piece.box, at)) return &piece;
        }
        if (failure_) std::rethrow_exception(failure_);
        if (complete_ || is_released(at))
            throw Error(ErrorKind::failure, "slices of a stream were asked for out of order");
        auto const begin = Clock::now();
        if (thread_.joinable()) {
            wait_for_thread(lock);
        } else {
            lock.unlock();
            receive();
            lock.lock();
        }
        wait_ += std::chrono::duration<double>(Clock::now() - begin).count();
    }
}

/// Takes the next slab if it lies in shared memory; from the first that does not, a thread reads them.
void StreamSource::Reader::receive() {
    if (!peek_slab()) {
        complete_ = true;
        return;
    }
    (void)space();
    if (pending_slab_->slab.place == Residence::here)
        start();
    else
        read_slab();
}

void StreamSource::Reader::read(AnyView out) {
    for_each_part(out.box, [&](Box const& rest) {
        Piece& piece = *piece_with(rest.lower);
        Box const part = first_part(rest, piece.box);
        copy_region(view_of(piece).part(part), out.part(part), Execution{});
        return part;
    });
}

std::optional<ConstView> StreamSource::Reader::borrow(Box const& region) {
    if (is_released(region.lower)) return std::nullopt; // a window holds those slices already
    Piece& piece = *piece_with(region.lower);
    if (!piece.box.contains(region) || piece.space != space()) return std::nullopt;
    return view_of(piece).part(region);
}

std::shared_ptr<Lease> StreamSource::Reader::lease(Box const& region) {
    if (!channel_ || !channel_->connected() || is_released(region.lower)) return nullptr;
    Piece const& piece = *piece_with(region.lower);
    return region == piece.box ? piece.lease : nullptr;
}

std::optional<Volume> StreamSource::Reader::take_whole() {
    if (!options_.whole || first_slab_height() == 0 || pending_slab_->slab.place != Residence::segment)
        return std::nullopt;
    std::uint32_t const name = pending_slab_->slab.slot;
    segment_ = name;
    segment_bytes_ = 0;
    finish(); // counts every slab and proves the end; the voxels lie where they are
    if (segment_bytes_ != header_.bytes())
        throw Error(ErrorKind::data, text("the volume on ", input_.name(), " lies in several places"));
    std::byte* const voxels = const_cast<std::byte*>(channel_->slot(name, header_.bytes())); // copy on write
    return Volume(header_, Buffer::adopt(voxels, header_.bytes(), channel_->memory_of(name)));
}

void StreamSource::Reader::finish() {
    if (!in_volume_) return;
    if (header_.kind == Kind::hierarchical && !header_.dry_run) {
        finish_bricks();
        return;
    }
    if (header_.dry_run) {
        FrameHeader frame;
        if (!complete_ && next_frame(frame)) throw Error(ErrorKind::data, text("unexpected voxels on ", input_.name()));
        in_volume_ = false;
        return;
    }
    if (!thread_.joinable()) {
        expected_ = {}; // what was not read yet is skipped
        while (!ready_.empty()) release_front();
        if (!complete_) read_slabs();
        complete_ = true;
    }
    while (true) {
        std::unique_lock lock(mutex_);
        while (!ready_.empty()) release_front();
        if (complete_) break;
        wait_for_thread(lock);
    }
    if (thread_.joinable()) thread_.join();
    in_volume_ = false;
    note_traffic();
    if (failure_) std::rethrow_exception(failure_);
}

/// The frame that comes next is one of bricks, from this one on; returns how many, and what is left of its payload.
BricksHeader StreamSource::Reader::read_bricks_head(FrameHeader const& frame, FrameType type, std::size_t first) {
    if (frame.type != type)
        throw Error(ErrorKind::data,
                    frame.type == FrameType::slab ? text("slabs in the hierarchical volume on ", input_.name())
                    : type == FrameType::tree ? text("the cells on ", input_.name(), " come before the table of bricks")
                                              : text("bricks on ", input_.name(), " are out of order"),
                    type == FrameType::tree ? "older versions of vkt wrote no table: make the volume again" : "");
    BricksHeader head;
    if (frame.length < sizeof head)
        throw Error(ErrorKind::data, text("a brick frame on ", input_.name(), " has no header"));
    if (input_.read(&head, sizeof head) != sizeof head) ended_early();
    if (head.first != first || head.count == 0 || head.count > static_cast<std::uint64_t>(header_.brick_count) - first)
        throw Error(ErrorKind::data, text("bricks on ", input_.name(), " are out of order"));
    return head;
}

/// The table of bricks, which grows with what arrives: the stated count allocates nothing.
void StreamSource::Reader::read_table() {
    if (header_.dry_run) throw PlannedOnly();
    if (table_) return;
    if (header_.brick_count < 0 || header_.brick_count > (std::int64_t{1} << 32))
        throw Error(ErrorKind::data, text("the brick count on ", input_.name(), " is impossible"));
    FrameHeader frame;
    if (header_.brick_count > 0 && !next_frame(frame))
        throw Error(ErrorKind::data, text("bricks are missing on ", input_.name()));
    table_ = frame.type == FrameType::packed ? read_numbers(frame) : read_records(frame);
    next_brick_ = framed_bricks_ = 0;
    frame_left_ = 0;
}

/// What is behind the head of a frame of the table.
std::vector<std::byte> StreamSource::Reader::read_table_frame(FrameHeader const& frame, FrameType type,
                                                              std::size_t first, std::size_t& count_of_bricks) {
    BricksHeader const head = read_bricks_head(frame, type, first);
    if (head.count > most_records || frame.length > sizeof head + most_records * sizeof(BrickRecord)) refuse_size();
    std::vector<std::byte> payload(frame.length - sizeof head);
    if (input_.read(payload.data(), payload.size()) != payload.size()) ended_early();
    if ((frame.flags & flag_checksum) != 0) verify(frame, hash(payload, hash(std::as_bytes(std::span(&head, 1)))));
    count(frame);
    count_of_bricks = head.count;
    return payload;
}

BrickTable StreamSource::Reader::read_records(FrameHeader frame) {
    std::vector<Brick> bricks;
    std::int64_t cells_left = header_.cell_count;
    while (static_cast<std::int64_t>(bricks.size()) < header_.brick_count) {
        if (!bricks.empty() && !next_frame(frame))
            throw Error(ErrorKind::data, text("bricks are missing on ", input_.name()));
        std::size_t count_here = 0;
        std::vector<std::byte> const payload = read_table_frame(frame, FrameType::tree, bricks.size(), count_here);
        if (payload.size() != count_here * sizeof(BrickRecord)) refuse_size();
        for (std::size_t i = 0; i < count_here; ++i) {
            BrickRecord r;
            std::memcpy(&r, payload.data() + i * sizeof r, sizeof r);
            Brick const brick{{r.lower[0], r.lower[1], r.lower[2]}, {r.dims[0], r.dims[1], r.dims[2]}, r.level};
            if (r.dims[0] < 1 || r.dims[1] < 1 || r.dims[2] < 1 || r.level < 0 || r.level >= header_.level_count ||
                static_cast<double>(r.dims[0]) * r.dims[1] * r.dims[2] > static_cast<double>(cells_left))
                throw Error(ErrorKind::data, text("a brick on ", input_.name(), " is impossible"));
            cells_left -= brick.cells();
            bricks.push_back(brick);
        }
    }
    if (cells_left != 0) throw Error(ErrorKind::data, text("bricks are missing on ", input_.name()));
    return {header_.dims, std::move(bricks)};
}

BrickTable StreamSource::Reader::read_numbers(FrameHeader frame) {
    std::vector<std::uint32_t> words;
    std::optional<BrickPacking> packing;
    for (std::size_t bricks = 0; static_cast<std::int64_t>(bricks) < header_.brick_count;) {
        if (packing && !next_frame(frame)) throw Error(ErrorKind::data, text("bricks are missing on ", input_.name()));
        std::size_t count_here = 0;
        std::vector<std::byte> const payload = read_table_frame(frame, FrameType::packed, bricks, count_here);
        PackingRecord record;
        if (payload.size() < sizeof record) refuse_size();
        std::memcpy(&record, payload.data(), sizeof record);
        auto const stated = BrickPacking::of_record(record, header_);
        if (!stated || (packing && *packing != *stated))
            throw Error(ErrorKind::data, text("the table on ", input_.name(), " is packed in an impossible way"));
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
        throw Error(error.kind(), text("the table on ", input_.name(), ": ", error.what()));
    }
}

void StreamSource::Reader::refuse_size() const {
    throw Error(ErrorKind::data, text("a brick frame on ", input_.name(), " has the wrong size"));
}

/// Begins the next frame of cells.
void StreamSource::Reader::open_bricks() {
    if (!next_frame(brick_frame_)) throw Error(ErrorKind::data, text("bricks are missing on ", input_.name()));
    BricksHeader const head = read_bricks_head(brick_frame_, FrameType::bricks, framed_bricks_);
    frame_left_ = cell_bytes(framed_bricks_, head.count);
    framed_bricks_ += head.count;
    bool const is_shared = (brick_frame_.flags & flag_shared) != 0;
    if (brick_frame_.length != sizeof head + (is_shared ? sizeof(SharedCells) : frame_left_)) refuse_size();
    shared_cells_ = nullptr;
    if (is_shared) {
        SharedCells shared;
        if (input_.read(&shared, sizeof shared) != sizeof shared) ended_early();
        shared_cells_ = shared_slot(shared.slot, frame_left_);
        shared_name_ = shared.slot;
    }
    frame_hash_ = std::make_unique<StreamHash>(hash(std::as_bytes(std::span(&head, 1))));
}

/// The frame of cells was read to its end.
void StreamSource::Reader::close_bricks() {
    if (shared_cells_ != nullptr) channel_->give_back(shared_name_);
    if ((brick_frame_.flags & flag_checksum) != 0) verify(brick_frame_, frame_hash_->value());
    count(brick_frame_);
}

/// The next n bytes of cells, across frames.
void StreamSource::Reader::take_cells(std::byte* to, std::size_t n) {
    while (n > 0) {
        if (frame_left_ == 0) open_bricks();
        std::size_t const step = std::min(n, frame_left_);
        if (shared_cells_ != nullptr) {
            std::memcpy(to, shared_cells_, step);
            shared_cells_ += step;
        } else if (std::size_t const got = input_.read(to, step); got != step) {
            bytes_ += got;
            ended_early();
        }
        bytes_ += step;
        if ((brick_frame_.flags & flag_checksum) != 0) frame_hash_->add({to, step});
        frame_left_ -= step;
        to += step;
        n -= step;
        if (frame_left_ == 0) close_bricks();
    }
}

/// Reads up to a brick; nobody wants the cells, but they are verified.
void StreamSource::Reader::pass_bricks(std::size_t end) {
    std::vector<std::byte> passed(std::min(cell_bytes(next_brick_, end - next_brick_), std::size_t{256} << 10));
    for (std::size_t left = cell_bytes(next_brick_, end - next_brick_); left > 0;) {
        std::size_t const step = std::min(left, passed.size());
        take_cells(passed.data(), step);
        left -= step;
    }
    next_brick_ = end;
}

std::size_t StreamSource::Reader::cell_bytes(std::size_t first, std::size_t count) const {
    return static_cast<std::size_t>(table_->cells(first, count)) * size_of(header_.dtype);
}

BrickSequence StreamSource::Reader::take_bricks() {
    read_table();
    BrickSequence sequence(
        header_, *table_,
        [this](std::size_t first, std::size_t count, std::byte* to) {
            if (first < next_brick_) throw Error(ErrorKind::failure, "bricks of a stream were asked for out of order");
            pass_bricks(first);
            take_cells(to, cell_bytes(first, count));
            next_brick_ = first + count;
        },
        BrickOrder::ascending);
    sequence.set_group_bytes(std::min(brick_group_bytes, std::max(options_.piece, least_group)));
    return sequence;
}

/// The rest of a hierarchical volume, and its end.
void StreamSource::Reader::finish_bricks() {
    read_table();
    pass_bricks(table_->size());
    FrameHeader frame;
    if (next_frame(frame)) throw Error(ErrorKind::data, text("there are more cells than bricks on ", input_.name()));
    complete_ = true;
    in_volume_ = false;
    table_.reset();
    note_traffic();
}

StreamSource::StreamSource(std::unique_ptr<ByteSource> bytes, StreamOptions options)
    : reader_(std::make_unique<Reader>(std::move(bytes), std::move(options))) {}
StreamSource::~StreamSource() = default;
bool StreamSource::next_volume() { return reader_->next_volume(); }
Header const& StreamSource::header() const { return reader_->header(); }
void StreamSource::read(AnyView out) { reader_->read(out); }
std::optional<ConstView> StreamSource::borrow(Box const& region) { return reader_->borrow(region); }
std::shared_ptr<Lease> StreamSource::lease(Box const& region) { return reader_->lease(region); }
void StreamSource::expect(Box const& region) { reader_->expect(region); }
std::int64_t StreamSource::natural_slab() const { return reader_->first_slab_height(); }
Space StreamSource::space() const { return reader_->space(); }
void StreamSource::finish() { reader_->finish(); }
BrickSequence StreamSource::take_bricks() { return reader_->take_bricks(); }
std::optional<Volume> StreamSource::take_whole() { return reader_->take_whole(); }
std::shared_ptr<StreamRecord const> StreamSource::record() const { return reader_->record(); }

} // namespace vkt::ipc
