// The writing end: slabs are filled in a small ring of reused buffers and written by a thread behind the computation.
// SPDX-License-Identifier: MIT
#include "ipc/channel.h"
#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "ipc/waiting.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/free_space.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace vkt::ipc {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t ring_slabs = 3;
/// Of slabs beyond this, one is filled while the other is written; a third would only hold memory.
constexpr std::size_t large_slab = std::size_t{4} << 20;
constexpr std::uint32_t shared_slots = 4;
constexpr std::chrono::milliseconds patience{250}; ///< for the next stage to take the offered memory
/// … if that is a GPU's: just to find GPUs takes processes that begin at once some tenths of a second.
constexpr std::chrono::milliseconds patience_on_gpu{1000};
/// From this size on mapping pages into the pipe beats copying them, and buffers come from fresh mappings.
constexpr std::size_t splice_bytes = std::size_t{512} << 10;
constexpr std::size_t mapped_bytes = std::size_t{2} << 20;
constexpr std::size_t bricks_per_frame = 4096;
/// A frame of several bricks holds no more than this: its cells stay in the caches from the file to the pipe.
constexpr std::size_t brick_frame_bytes = std::size_t{4} << 20;

struct Slab {
    Box box;
    Buffer voxels;
    std::size_t bytes = 0;
    std::optional<std::uint32_t> slot; ///< in shared memory, by name
    std::uint64_t spliced_at = 0;      ///< bytes written when its pages had gone into the pipe
};

iovec part(void const* data, std::size_t bytes) { return {const_cast<void*>(data), bytes}; }

} // namespace

class StreamSink::Writer {
public:
    Writer(int descriptor, StreamOptions options)
        : descriptor_(descriptor), options_(std::move(options)), pipe_bytes_(enlarge_pipe(descriptor)) {
        if (pipe_bytes_ > 0) channel_ = std::make_unique<ProducerChannel>(descriptor);
        if (options_.waiting)
            waiting_ = [this] {
                if (cancel_) throw Error(ErrorKind::cancelled, "cancelled");
                options_.waiting();
            };
    }
    ~Writer() { stop(true); }
    Writer(Writer const&) = delete;
    Writer& operator=(Writer const&) = delete;

    void begin(Header const& header);
    AnyView acquire(Box const& box);
    void commit();
    bool pass_on(Box const& box, std::shared_ptr<Lease> const& lease);
    void end();
    void close() { stop(false); }
    void fail(std::string const& stage, std::string const& message);
    void put_bricks(BrickSequence& sequence);
    Traffic traffic() const { return {wait_, written_}; }
    Space space() const { return on_gpu_ ? options_.gpu->space() : Space::host; }
    std::int64_t natural_slab() const;
    char const* way() const { return on_gpu_ ? "GPU memory" : shares_ ? "shared memory" : "pipe"; }

    std::function<std::vector<StageReport>()> reports;

private:
    void write_text(FrameType type, std::string const& payload, bool with_magic);
    void write_slab(Slab& slab);
    void write_frame(FrameHeader frame, std::span<iovec> parts);
    void write_voxels(FrameHeader const& frame, std::span<std::byte const> head, Slab& slab);
    void meet_consumer();
    void tell_once(std::string const& reason);
    bool share(std::size_t bytes);
    bool take_slot(std::size_t bytes);
    void write_table(BrickTable const& bricks);
    void write_table_frame(FrameType type, BricksHeader const& head, std::span<std::byte const> bytes);
    void write_bricks(BricksHeader const& head, std::span<std::byte const> cells, std::size_t most);
    void count(FrameHeader const& frame, std::size_t bytes);
    bool may_splice(Slab const& slab);
    void recycle(Slab slab);
    void work();
    void wait_until_written();
    void stop(bool cancel);

    int descriptor_;
    StreamOptions options_;
    std::size_t pipe_bytes_ = 0; ///< capacity of the pipe; 0 if the output is no pipe
    std::unique_ptr<ProducerChannel> channel_;
    bool shares_ = false;  ///< slabs go through shared memory,
    bool on_gpu_ = false;  ///< which is a GPU's
    bool segment_ = false; ///< the whole volume lies in one piece of it
    bool direct_ = false;  ///< the reader copies out of the pipe itself, so pages may be mapped into it
    bool told_ = false;
    Header header_;
    EndReport end_;
    double wait_ = 0;
    std::uint64_t written_ = 0;
    bool open_volume_ = false;

    std::thread thread_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Slab> queue_;
    std::vector<Slab> spare_;
    std::deque<Slab> in_pipe_; ///< their pages may still be referenced by the pipe
    std::size_t slabs_ = 0;    ///< buffers in circulation
    bool busy_ = false, stop_ = false;
    std::atomic<bool> cancel_{false};
    std::exception_ptr failure_;
    Slab current_;
    std::function<void()> waiting_; ///< for room; empty if only the system ends that
};

void StreamSink::Writer::write_frame(FrameHeader frame, std::span<iovec> parts) {
    frame = sealed(frame);
    std::vector<iovec> all{part(&frame, sizeof frame)};
    all.insert(all.end(), parts.begin(), parts.end());
    for (auto const& p : all) written_ += p.iov_len;
    write_all(descriptor_, all, waiting_);
}

void StreamSink::Writer::write_text(FrameType type, std::string const& payload, bool with_magic) {
    FrameHeader frame{type, flag_required, payload.size(), 0, 0};
    if (options_.checksum) {
        frame.flags |= flag_checksum;
        frame.checksum = hash(std::as_bytes(std::span(payload)));
    }
    if (with_magic) {
        std::array<iovec, 1> start{part(magic.data(), magic.size())};
        written_ += magic.size();
        write_all(descriptor_, start, waiting_);
    }
    std::array<iovec, 1> body{part(payload.data(), payload.size())};
    write_frame(frame, body);
}

void StreamSink::Writer::begin(Header const& header) {
    wait_until_written();
    if (!header.dry_run) require_space(descriptor_, header.bytes(), "cannot write the stream");
    header_ = header;
    end_ = {};
    std::string json = to_json(header);
    // Magic, frame header and text together fill whole 64-byte lines, so that voxels in files are aligned.
    json.push_back('\n');
    while ((magic.size() + sizeof(FrameHeader) + json.size()) % 64 != 0) json.insert(json.size() - 1, 1, ' ');
    write_text(FrameType::header, json, true);
    open_volume_ = true;
    if (options_.transport != Transport::pipe && !header.dry_run) meet_consumer();
}

/// Why voxels take another way than they were asked to.
void StreamSink::Writer::tell_once(std::string const& reason) {
    if (std::exchange(told_, true) || !options_.notice) return;
    options_.notice(text(reason, ": voxels go through ", shares_ ? "shared memory" : "the pipe"));
}

void StreamSink::Writer::meet_consumer() {
    shares_ = channel_ && channel_->connected(options_.transport == Transport::gpu ? patience_on_gpu : patience);
    segment_ = false;
    if (shares_ && channel_->wants_whole() && header_.kind == Kind::structured) {
        try {
            channel_->share_ring(1, header_.bytes());
            segment_ = true;
        } catch (Error const&) { // too large to hold: a ring will do
        }
    }
    on_gpu_ = false;
    if (!shares_) return tell_once("the next stage does not share memory");
    if (options_.transport != Transport::gpu || header_.kind != Kind::structured) return;
    std::string const obstacle = channel_->gpu_obstacle(*options_.gpu);
    on_gpu_ = obstacle.empty() && !segment_;
    if (!obstacle.empty()) tell_once(obstacle);
}

std::int64_t StreamSink::Writer::natural_slab() const {
    if (!on_gpu_) return 0;
    auto const slice = static_cast<std::size_t>(header_.dims.x * header_.dims.y) * size_of(header_.dtype);
    return static_cast<std::int64_t>(std::max<std::size_t>(1, options_.gpu->slab_bytes() / slice));
}

/// Makes the ring, if there is none that will do. False if there is no such memory to be had.
bool StreamSink::Writer::share(std::size_t bytes) {
    SharedRing const* const ring = channel_->ring();
    if (ring != nullptr && ring->on_gpu() == on_gpu_ && ring->slots() >= shared_slots && ring->slot_bytes() >= bytes)
        return true;
    try {
        channel_->share_ring(shared_slots, bytes, on_gpu_ ? options_.gpu : nullptr);
        return true;
    } catch (Error const& e) {
        (on_gpu_ ? on_gpu_ : shares_) = false;
        tell_once(e.what());
        return false;
    }
}

/// Puts the current slab into a slot of shared memory that has so many bytes; false if there is none to be had.
bool StreamSink::Writer::take_slot(std::size_t bytes) {
    while (shares_ && !share(bytes)) { // the host's memory may do where a GPU's does not
    }
    if (!shares_) return false;
    auto const begin = Clock::now();
    current_.slot = channel_->acquire_slot(options_.waiting);
    wait_ += std::chrono::duration<double>(Clock::now() - begin).count();
    return true;
}

AnyView StreamSink::Writer::acquire(Box const& box) {
    current_.bytes = static_cast<std::size_t>(box.voxels()) * size_of(header_.dtype);
    if (shares_) {
        current_.box = box;
        if (segment_) {
            current_.slot = channel_->segment();
            auto const slice = static_cast<std::size_t>(header_.dims.x * header_.dims.y) * size_of(header_.dtype);
            std::size_t const row = slice / static_cast<std::size_t>(header_.dims.y);
            return dense_view(channel_->slot(*current_.slot) + static_cast<std::size_t>(box.lower.z) * slice +
                                  static_cast<std::size_t>(box.lower.y) * row,
                              header_.dtype, box);
        }
        if (take_slot(current_.bytes)) return dense_view(channel_->slot(*current_.slot), header_.dtype, box, space());
    }
    {
        std::unique_lock lock(mutex_);
        auto const begin = Clock::now();
        auto const room = [&] {
            return failure_ || !spare_.empty() ||
                   slabs_ < (current_.bytes > large_slab ? ring_slabs - 1 : ring_slabs) + in_pipe_.size();
        };
        wait_for(changed_, lock, room, waiting_);
        wait_ += std::chrono::duration<double>(Clock::now() - begin).count();
        if (failure_) std::rethrow_exception(failure_);
        if (spare_.empty()) {
            ++slabs_;
            current_ = {};
        } else {
            current_ = std::move(spare_.back());
            spare_.pop_back();
        }
    }
    current_.box = box;
    current_.bytes = static_cast<std::size_t>(box.voxels()) * size_of(header_.dtype);
    bool const splices = channel_ && current_.bytes >= splice_bytes;
    current_.voxels.reserve(splices ? std::max(current_.bytes, mapped_bytes) : current_.bytes);
    return dense_view(current_.voxels.write(Space::host), header_.dtype, box);
}

void StreamSink::Writer::commit() {
    if (current_.slot) {
        channel_->ring()->settle();
        // A frame of a few bytes: the pipe always has room for as many as there are slots.
        write_slab(current_);
        current_ = {};
        return;
    }
    std::lock_guard const lock(mutex_);
    queue_.push_back(std::move(current_));
    changed_.notify_all();
    if (!thread_.joinable()) thread_ = std::thread([this] { work(); });
}

bool StreamSink::Writer::pass_on(Box const& box, std::shared_ptr<Lease> const& lease) {
    if (!shares_ || segment_) return false;
    auto slot = std::dynamic_pointer_cast<SlotLease>(lease);
    Slab slab{box, {}, static_cast<std::size_t>(box.voxels()) * size_of(header_.dtype), {}, 0};
    if (!slot || slot->bytes() != slab.bytes || slot->ring()->on_gpu() != on_gpu_) return false;
    auto const begin = Clock::now();
    try {
        slab.slot = channel_->pass_on(std::move(slot));
    } catch (Error const&) { // too many rings were handed on
        return false;
    }
    wait_ += std::chrono::duration<double>(Clock::now() - begin).count();
    write_slab(slab);
    return true;
}

void StreamSink::Writer::work() {
    std::unique_lock lock(mutex_);
    while (true) {
        changed_.wait(lock, [&] { return stop_ || !queue_.empty(); });
        if (cancel_ || queue_.empty()) return;
        Slab slab = std::move(queue_.front());
        queue_.pop_front();
        busy_ = true;
        lock.unlock();
        try {
            write_slab(slab);
            lock.lock();
            recycle(std::move(slab));
        } catch (...) {
            if (!lock.owns_lock()) lock.lock();
            failure_ = std::current_exception();
        }
        busy_ = false;
        changed_.notify_all();
        if (failure_) return;
    }
}

/// The reader must be a vkt process at the other end of this very pipe: others (pv, tee) may keep references to the
/// pages.
bool StreamSink::Writer::may_splice(Slab const& slab) {
    if (!channel_ || slab.bytes < splice_bytes || slab.voxels.bytes() < mapped_bytes) return false;
    if (!direct_) direct_ = channel_->connected();
    return direct_;
}

/// Makes a written slab's buffer available again, once the pipe can no longer hold pages of it: after as many further
/// bytes as the pipe has room for.
void StreamSink::Writer::recycle(Slab slab) {
    if (slab.spliced_at > 0)
        in_pipe_.push_back(std::move(slab));
    else
        spare_.push_back(std::move(slab));
    while (!in_pipe_.empty() && written_ >= in_pipe_.front().spliced_at + pipe_bytes_) {
        in_pipe_.front().spliced_at = 0;
        spare_.push_back(std::move(in_pipe_.front()));
        in_pipe_.pop_front();
    }
}

void StreamSink::Writer::write_slab(Slab& slab) {
    Residence const place = !slab.slot ? Residence::here : segment_ ? Residence::segment : Residence::shared;
    SlabHead const whole{{slab.box.lower.z, slab.box.upper.z, place, slab.slot.value_or(0), slab.bytes},
                         {slab.box.lower.y, slab.box.upper.y}};
    bool const rows = slab.box.dims().y < header_.dims.y;
    std::span<std::byte const> const head = whole.bytes(rows);
    FrameHeader frame{FrameType::slab, flag_required | (rows ? flag_rows : 0u),
                      head.size() + (slab.slot ? 0 : slab.bytes), 0, 0};
    if (options_.checksum &&
        !slab.slot) { // shared voxels never leave memory: there is no way on which they could be damaged
        frame.flags |= flag_checksum;
        frame.checksum = hash({slab.voxels.read(Space::host), slab.bytes}, hash(head));
    }
    write_voxels(frame, head, slab);
    count(frame, slab.bytes);
}

/// For END, a frame that was written with so many bytes of voxels.
void StreamSink::Writer::count(FrameHeader const& frame, std::size_t bytes) {
    ++end_.frames;
    end_.bytes += bytes;
    end_.checksum = hash(std::as_bytes(std::span(&frame.checksum, 1)), end_.checksum);
}

void StreamSink::Writer::write_voxels(FrameHeader const& frame, std::span<std::byte const> head, Slab& slab) {
    std::array<iovec, 2> parts{part(head.data(), head.size()), part(nullptr, 0)};
    if (slab.slot) return write_frame(frame, std::span(parts).first(1));
    std::byte const* const voxels = slab.voxels.read(Space::host);
    if (!may_splice(slab)) {
        parts[1] = part(voxels, slab.bytes);
        return write_frame(frame, parts);
    }
    write_frame(frame, std::span(parts).first(1));
    splice_all(descriptor_, voxels, slab.bytes, waiting_);
    written_ += slab.bytes;
    slab.spliced_at = written_;
}

/// The table first, so that readers know the tree before its cells come: as numbers, if readers can tell from the
/// header how they are packed.
void StreamSink::Writer::write_table(BrickTable const& bricks) {
    PackingRecord const packing = bricks.packing_for(header_);
    std::size_t n = 0;
    for (std::size_t first = 0; first < bricks.size(); first += n) {
        n = std::min(bricks_per_frame, bricks.size() - first);
        BrickTable const some = bricks.part(first, n);
        if (packing.words > 0) {
            std::vector<std::uint32_t> payload(sizeof packing / sizeof(std::uint32_t));
            std::memcpy(payload.data(), &packing, sizeof packing);
            payload.insert(payload.end(), some.words().begin(), some.words().end());
            write_table_frame(FrameType::packed, {first, n}, std::as_bytes(std::span(payload)));
            continue;
        }
        std::vector<BrickRecord> records;
        for (Brick const& b : some)
            records.push_back({{b.lower.x, b.lower.y, b.lower.z},
                               {static_cast<std::int32_t>(b.dims.x), static_cast<std::int32_t>(b.dims.y),
                                static_cast<std::int32_t>(b.dims.z)},
                               b.level});
        write_table_frame(FrameType::tree, {first, n}, std::as_bytes(std::span(records)));
    }
}

void StreamSink::Writer::write_table_frame(FrameType type, BricksHeader const& head, std::span<std::byte const> bytes) {
    FrameHeader frame{type, flag_required, sizeof head + bytes.size(), 0, 0};
    if (options_.checksum) {
        frame.flags |= flag_checksum;
        frame.checksum = hash(bytes, hash(std::as_bytes(std::span(&head, 1))));
    }
    std::array<iovec, 2> parts{part(&head, sizeof head), part(bytes.data(), bytes.size())};
    write_frame(frame, parts);
    count(frame, 0);
}

void StreamSink::Writer::put_bricks(BrickSequence& sequence) {
    auto const& bricks = sequence.bricks();
    std::size_t const limit = std::min(brick_frame_bytes, sequence.group_bytes()),
                      size = size_of(sequence.header().dtype);
    auto const frame_of = [&](std::size_t first) { return std::min(sequence.group(first, limit), bricks_per_frame); };
    auto const bytes_of = [&](std::size_t first, std::size_t n) {
        return static_cast<std::size_t>(bricks.cells(first, n)) * size;
    };
    write_table(bricks);
    std::size_t most = 0; // of all frames, so that one ring of slots does for them
    for (std::size_t first = 0, n = 0; first < bricks.size(); first += n) {
        n = frame_of(first);
        most = std::max(most, bytes_of(first, n));
    }
    for (std::size_t first = 0, n = 0; first < bricks.size(); first += n) {
        n = frame_of(first);
        write_bricks({first, n}, {sequence.cells(first, n), bytes_of(first, n)}, most);
    }
}

void StreamSink::Writer::write_bricks(BricksHeader const& head, std::span<std::byte const> cells, std::size_t most) {
    current_ = {};
    current_.bytes = cells.size();
    FrameHeader frame{FrameType::bricks, flag_required, sizeof head, 0, 0};
    SharedCells shared;
    std::array<iovec, 2> parts{part(&head, sizeof head), part(cells.data(), cells.size())};
    if (shares_ && take_slot(most)) {
        std::memcpy(channel_->slot(*current_.slot), cells.data(), cells.size());
        shared.slot = *current_.slot;
        parts[1] = part(&shared, sizeof shared);
        frame.flags |= flag_shared;
    } else if (options_.checksum) {
        frame.flags |= flag_checksum;
        frame.checksum = hash(cells, hash(std::as_bytes(std::span(&head, 1))));
    }
    frame.length += parts[1].iov_len;
    write_frame(frame, parts);
    count(frame, cells.size());
}

void StreamSink::Writer::wait_until_written() {
    std::unique_lock lock(mutex_);
    auto const begin = Clock::now();
    wait_for(
        changed_, lock, [&] { return failure_ || (queue_.empty() && !busy_); }, waiting_);
    wait_ += std::chrono::duration<double>(Clock::now() - begin).count();
    if (failure_) std::rethrow_exception(failure_);
}

void StreamSink::Writer::end() {
    wait_until_written();
    if (!options_.checksum) end_.checksum = 0;
    if (reports && header_.timing) end_.stages = reports();
    write_text(FrameType::end, to_json(end_), false);
    open_volume_ = false;
}

void StreamSink::Writer::stop(bool cancel) {
    if (!thread_.joinable()) return;
    {
        std::lock_guard const lock(mutex_);
        stop_ = true;
        cancel_ = cancel;
        changed_.notify_all();
    }
    thread_.join();
    stop_ = cancel_ = false;
    if (!cancel && failure_) std::rethrow_exception(failure_);
}

void StreamSink::Writer::fail(std::string const& stage, std::string const& message) {
    stop(true);
    if (failure_) return; // the reader is gone or the disk is full: nobody can be told
    // Also before any volume: an ERR frame may stand where a header would.
    write_text(FrameType::error, to_json(ErrorReport{stage, message, 1}), !open_volume_);
}

StreamSink::StreamSink(int descriptor, StreamOptions options)
    : writer_(std::make_unique<Writer>(descriptor, std::move(options))) {}
StreamSink::~StreamSink() = default;
void StreamSink::begin(Header const& header) { writer_->begin(header); }
AnyView StreamSink::acquire(Box const& slab) { return writer_->acquire(slab); }
void StreamSink::commit() { writer_->commit(); }
bool StreamSink::pass_on(Box const& slab, std::shared_ptr<Lease> const& lease) { return writer_->pass_on(slab, lease); }
void StreamSink::end() { writer_->end(); }
void StreamSink::close() { writer_->close(); }
void StreamSink::fail(std::string const& stage, std::string const& message) { writer_->fail(stage, message); }
void StreamSink::put_bricks(BrickSequence bricks) { writer_->put_bricks(bricks); }
Traffic StreamSink::traffic() const { return writer_->traffic(); }
Space StreamSink::space() const { return writer_->space(); }
std::int64_t StreamSink::natural_slab() const { return writer_->natural_slab(); }
char const* StreamSink::way() const { return writer_->way(); }
void StreamSink::report_stages(std::function<std::vector<StageReport>()> reports) {
    writer_->reports = std::move(reports);
}

} // namespace vkt::ipc
