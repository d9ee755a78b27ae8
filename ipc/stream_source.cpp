// The reading end: reads slabs ahead on a thread into a small ring that is reused. Slabs in shared memory need no
// thread: the writer fills them ahead of us, and only their frames are read.
// SPDX-License-Identifier: MIT
#include "ipc/brick_reader.h"
#include "ipc/channel.h"
#include "ipc/frame_reader.h"
#include "ipc/stream.h"
#include "ipc/waiting.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/formats/stream_reader.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace vkt::ipc {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t slabs_ahead = 2;
/// Slabs beyond this are handed out slice by slice, so that no frame decides how much memory a reader needs.
constexpr std::size_t piece_bytes = std::size_t{2} << 20;

struct Piece {
    Box box;
    Buffer voxels;
    std::byte const* shared = nullptr;  ///< where they lie in shared memory,
    Space space = Space::host;          ///< which may be a GPU's
    std::shared_ptr<SlotLease> lease{}; ///< that keeps them there
};

} // namespace

class StreamSource::Reader {
public:
    Reader(std::unique_ptr<ByteSource> bytes, StreamOptions options)
        : options_(std::move(options)), frames_(std::move(bytes), options_) {}
    ~Reader() {
        stop();
        frames_.note_traffic(wait_);
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
    BrickSequence take_bricks() { return bricks_->take(); }
    std::optional<Volume> take_whole();
    std::shared_ptr<StreamRecord const> record() const { return frames_.record(); }

private:
    bool peek_slab();
    SlabHead read_slab_head(FrameHeader const& frame);
    Cut pieces_of(Box const& slab) const;
    void read_slabs();
    bool read_slab();
    bool wanted(Box const& slab) const;
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
    void read_shared(SlabHead const& head);
    void receive();
    std::size_t slice_bytes() const {
        return static_cast<std::size_t>(header_.dims.x * header_.dims.y) * size_of(header_.dtype);
    }
    ConstView view_of(Piece& piece) const {
        return dense_view(piece.shared != nullptr ? piece.shared : piece.voxels.read(Space::host), header_.dtype,
                          piece.box, piece.space);
    }

    StreamOptions options_;
    FrameReader frames_;
    Header const& header_ = frames_.header(); ///< of the current volume
    bool in_volume_ = false;
    std::optional<BrickReader> bricks_; ///< of the current volume
    Box expected_;
    std::optional<FrameHeader> pending_; ///< first frame, read to learn the slab height
    std::optional<SlabHead> pending_slab_;
    std::optional<std::int64_t> first_height_; ///< slices of the first slab, once that is known
    PieceOrder order_;                         ///< of the slabs
    std::optional<std::uint32_t> segment_;     ///< that take_whole() hands out
    std::uint64_t segment_bytes_ = 0;
    std::optional<Space> space_; ///< of the first slab, once that is known
    double wait_ = 0;

    std::thread thread_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Piece> ready_;
    std::vector<Piece> spare_;
    Index3 released_; ///< what lies before this row is gone
    bool complete_ = false, cancel_ = false;
    std::exception_ptr failure_;
};

bool StreamSource::Reader::next_volume() {
    if (in_volume_) finish();
    frames_.note_traffic(wait_);
    if (!frames_.next_volume()) return false;
    in_volume_ = true;
    complete_ = false;
    order_ = PieceOrder(header_.dims);
    released_ = {};
    expected_ = box_of(header_.dims);
    pending_.reset();
    pending_slab_.reset();
    first_height_.reset();
    bricks_.emplace(frames_, options_.piece);
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
    if (frame.length < bytes) throw Error(ErrorKind::data, text("a slab on ", frames_.name(), " has no header"));
    frames_.read(&head, bytes);
    if (!rows) head.rows = {0, header_.dims.y};
    Box const box = box_of_slab(head);
    // Extents only once the order has shown them to be within the volume: nothing is multiplied before.
    if (!order_.takes(box) || slab.bytes != static_cast<std::uint64_t>(box.voxels()) * size_of(header_.dtype) ||
        frame.length != bytes + (slab.place == Residence::here ? slab.bytes : 0) ||
        (slab.place != Residence::here && slab.place != Residence::shared && slab.place != Residence::segment))
        throw Error(ErrorKind::data, text("a slab on ", frames_.name(), " is out of order or of the wrong size"));
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
    if (!frames_.next(frame)) return false;
    if (frame.type != FrameType::slab)
        throw Error(ErrorKind::data, text("bricks in the structured volume on ", frames_.name()));
    pending_slab_ = read_slab_head(frame);
    pending_ = frame;
    if (!first_height_) {
        Box const slab = box_of_slab(*pending_slab_);
        first_height_ = pending_slab_->slab.place != Residence::here ? slab.dims().z
                                                                     : std::min(slab.dims().z, pieces_of(slab).slices);
    }
    return true;
}

std::int64_t StreamSource::Reader::first_slab_height() {
    if (thread_.joinable() || complete_ || header_.dry_run || header_.kind != Kind::structured) return 0;
    if (!first_height_ && !peek_slab())
        throw Error(ErrorKind::data, text("the volume on ", frames_.name(), " has no slabs"));
    return *first_height_; // also once that slab, or the last, has been read
}

Space StreamSource::Reader::space() {
    if (!options_.gpu || header_.dry_run || header_.kind != Kind::structured) return Space::host;
    if (!space_) {
        bool const shared = first_slab_height() > 0 && pending_slab_ && pending_slab_->slab.place == Residence::shared;
        if (shared) (void)frames_.shared_slot(pending_slab_->slab.slot, pending_slab_->slab.bytes);
        space_ = shared ? frames_.channel()->memory_of(pending_slab_->slab.slot)->space() : Space::host;
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
    frames_.cancel(); // it may sit in read(2) for as long as upstream pleases
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
    changed_.wait(lock, [&] { return cancel_ || ready_.size() < slabs_ahead; });
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

void StreamSource::Reader::read_shared(SlabHead const& head) {
    SlabHeader const& slab = head.slab;
    Piece piece;
    piece.box = box_of_slab(head);
    if (slab.place == Residence::segment) {
        if (slab.slot == segment_) segment_bytes_ += slab.bytes;
        std::size_t const slice = slice_bytes(), row = slice / static_cast<std::size_t>(header_.dims.y);
        piece.shared = frames_.shared_slot(slab.slot, header_.bytes()) +
                       static_cast<std::size_t>(piece.box.lower.z) * slice +
                       static_cast<std::size_t>(piece.box.lower.y) * row;
    } else {
        piece.shared = frames_.shared_slot(slab.slot, slab.bytes);
        piece.lease = std::make_shared<SlotLease>(frames_.channel(), slab.slot, slab.bytes);
        piece.space = piece.lease->ring()->space();
    }
    if (wanted(piece.box)) hand_out(std::move(piece));
    frames_.count_voxels(slab.bytes);
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
        frames_.skip_voxels(slab.bytes);
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
                frames_.read_voxels(target + done, n);
                if (check) hasher.add({target + done, n});
            }
            hand_out(std::move(piece));
            return part;
        });
        frames_.verify(frame, check ? hasher.value() : 0);
    }
    frames_.count(frame);
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
    if (!frames_.channel() || !frames_.channel()->connected() || is_released(region.lower)) return nullptr;
    Piece const& piece = *piece_with(region.lower);
    return region == piece.box ? piece.lease : nullptr;
}

std::optional<Volume> StreamSource::Reader::take_whole() {
    if (!options_.whole || first_slab_height() == 0 || !pending_slab_ ||
        pending_slab_->slab.place != Residence::segment)
        return std::nullopt;
    std::uint32_t const name = pending_slab_->slab.slot;
    segment_ = name;
    segment_bytes_ = 0;
    finish(); // counts every slab and proves the end; the voxels lie where they are
    if (segment_bytes_ != header_.bytes())
        throw Error(ErrorKind::data, text("the volume on ", frames_.name(), " lies in several places"));
    std::byte* const voxels = const_cast<std::byte*>(frames_.channel()->slot(name, header_.bytes())); // copy on write
    return Volume(header_, Buffer::adopt(voxels, header_.bytes(), frames_.channel()->memory_of(name)));
}

void StreamSource::Reader::finish() {
    if (!in_volume_) return;
    if (header_.kind == Kind::hierarchical && !header_.dry_run) {
        bricks_->finish();
        complete_ = true;
        in_volume_ = false;
        frames_.note_traffic(wait_);
        return;
    }
    if (header_.dry_run) {
        FrameHeader frame;
        if (!complete_ && frames_.next(frame))
            throw Error(ErrorKind::data, text("unexpected voxels on ", frames_.name()));
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
    frames_.note_traffic(wait_);
    if (failure_) std::rethrow_exception(failure_);
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

namespace vkt {

bool begins_stream(std::span<std::byte const> head) { return ipc::is_stream(head); }
std::unique_ptr<Source> open_stream(std::unique_ptr<ByteSource> bytes) {
    return std::make_unique<ipc::StreamSource>(std::move(bytes), ipc::StreamOptions{});
}

} // namespace vkt
