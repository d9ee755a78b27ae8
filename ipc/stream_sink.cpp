// The writing end: slabs are filled in a small ring of reused buffers and written by a thread behind the computation.
// SPDX-License-Identifier: MIT
#include "ipc/descriptor.h"
#include "ipc/stream.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

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
constexpr std::size_t bricks_per_frame = 4096;

struct Slab {
    Box box;
    Buffer voxels;
    std::size_t bytes = 0;
};

iovec part(void const* data, std::size_t bytes) { return {const_cast<void*>(data), bytes}; }

} // namespace

class StreamSink::Writer {
public:
    Writer(int descriptor, StreamOptions options) : descriptor_(descriptor), options_(std::move(options)) { enlarge_pipe(descriptor); }
    ~Writer() { stop(true); }
    Writer(Writer const&) = delete;
    Writer& operator=(Writer const&) = delete;

    void begin(Header const& header);
    AnyView acquire(Box const& box);
    void commit();
    void end();
    void close() { stop(false); }
    void fail(std::string const& stage, std::string const& message);
    void put_hierarchical(Volume const& volume);
    Traffic traffic() const { return {wait_, written_}; }

    std::function<std::vector<StageReport>()> reports;

private:
    void write_text(FrameType type, std::string const& payload, bool with_magic);
    void write_slab(Slab& slab);
    void write_frame(FrameHeader frame, std::span<iovec> parts);
    void work();
    void wait_until_written();
    void stop(bool cancel);

    int descriptor_;
    StreamOptions options_;
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
    std::size_t slabs_ = 0;  ///< buffers in circulation
    bool busy_ = false, stop_ = false, cancel_ = false;
    std::exception_ptr failure_;
    Slab current_;
};

void StreamSink::Writer::write_frame(FrameHeader frame, std::span<iovec> parts) {
    frame = sealed(frame);
    std::vector<iovec> all{part(&frame, sizeof frame)};
    all.insert(all.end(), parts.begin(), parts.end());
    for (auto const& p : all) written_ += p.iov_len;
    write_all(descriptor_, all);
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
        write_all(descriptor_, start);
    }
    std::array<iovec, 1> body{part(payload.data(), payload.size())};
    write_frame(frame, body);
}

void StreamSink::Writer::begin(Header const& header) {
    wait_until_written();
    header_ = header;
    end_ = {};
    std::string json = to_json(header);
    // Magic, frame header and text together fill whole 64-byte lines, so that voxels in files are aligned.
    json.push_back('\n');
    while ((magic.size() + sizeof(FrameHeader) + json.size()) % 64 != 0) json.insert(json.size() - 1, 1, ' ');
    write_text(FrameType::header, json, true);
    open_volume_ = true;
}

AnyView StreamSink::Writer::acquire(Box const& box) {
    {
        std::unique_lock lock(mutex_);
        auto const begin = Clock::now();
        changed_.wait(lock, [&] { return failure_ || !spare_.empty() || slabs_ < ring_slabs; });
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
    current_.voxels.reserve(current_.bytes);
    return dense_view(current_.voxels.write(Space::host), header_.dtype, box);
}

void StreamSink::Writer::commit() {
    std::lock_guard const lock(mutex_);
    queue_.push_back(std::move(current_));
    changed_.notify_all();
    if (!thread_.joinable()) thread_ = std::thread([this] { work(); });
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
        std::exception_ptr failure;
        try {
            write_slab(slab);
        } catch (...) {
            failure = std::current_exception();
        }
        lock.lock();
        busy_ = false;
        spare_.push_back(std::move(slab));
        if (failure) failure_ = failure;
        changed_.notify_all();
        if (failure_) return;
    }
}

void StreamSink::Writer::write_slab(Slab& slab) {
    SlabHeader const head{slab.box.lower.z, slab.box.upper.z, Place::here, 0, slab.bytes};
    std::byte const* const voxels = slab.voxels.read(Space::host);
    FrameHeader frame{FrameType::slab, flag_required, sizeof head + slab.bytes, 0, 0};
    if (options_.checksum) {
        frame.flags |= flag_checksum;
        frame.checksum = hash({voxels, slab.bytes}, hash(std::as_bytes(std::span(&head, 1))));
    }
    std::array<iovec, 2> parts{part(&head, sizeof head), part(voxels, slab.bytes)};
    write_frame(frame, parts);
    ++end_.frames;
    end_.bytes += slab.bytes;
    end_.checksum = hash(std::as_bytes(std::span(&frame.checksum, 1)), end_.checksum);
}

void StreamSink::Writer::put_hierarchical(Volume const& volume) {
    auto const& bricks = volume.bricks();
    std::size_t const size = size_of(volume.header().dtype);
    std::byte const* const cells = volume.buffer().read(Space::host);
    std::vector<BrickRecord> records;
    for (std::size_t first = 0; first < bricks.size(); first += records.size()) {
        records.clear();
        std::int64_t count = 0;
        for (std::size_t i = first; i < bricks.size() && records.size() < bricks_per_frame; ++i) {
            Brick const& b = bricks[i];
            records.push_back({{b.lower.x, b.lower.y, b.lower.z},
                               {static_cast<std::int32_t>(b.dims.x), static_cast<std::int32_t>(b.dims.y), static_cast<std::int32_t>(b.dims.z)},
                               b.level});
            count += b.cells();
        }
        BricksHeader const group{first, records.size()};
        auto const record_bytes = records.size() * sizeof(BrickRecord);
        std::byte const* const data = cells + static_cast<std::size_t>(volume.brick_offset(first)) * size;
        std::size_t const bytes = static_cast<std::size_t>(count) * size;
        FrameHeader frame{FrameType::bricks, flag_required, sizeof group + record_bytes + bytes, 0, 0};
        if (options_.checksum) {
            frame.flags |= flag_checksum;
            StreamHash hasher(hash(std::as_bytes(std::span(&group, 1))));
            hasher.add(std::as_bytes(std::span(records)));
            hasher.add({data, bytes});
            frame.checksum = hasher.value();
        }
        std::array<iovec, 3> parts{part(&group, sizeof group), part(records.data(), record_bytes), part(data, bytes)};
        write_frame(frame, parts);
        ++end_.frames;
        end_.bytes += bytes;
        end_.checksum = hash(std::as_bytes(std::span(&frame.checksum, 1)), end_.checksum);
    }
}

void StreamSink::Writer::wait_until_written() {
    std::unique_lock lock(mutex_);
    auto const begin = Clock::now();
    changed_.wait(lock, [&] { return failure_ || (queue_.empty() && !busy_); });
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

StreamSink::StreamSink(int descriptor, StreamOptions options) : writer_(std::make_unique<Writer>(descriptor, std::move(options))) {}
StreamSink::~StreamSink() = default;
void StreamSink::begin(Header const& header) { writer_->begin(header); }
AnyView StreamSink::acquire(Box const& slab) { return writer_->acquire(slab); }
void StreamSink::commit() { writer_->commit(); }
void StreamSink::end() { writer_->end(); }
void StreamSink::close() { writer_->close(); }
void StreamSink::fail(std::string const& stage, std::string const& message) { writer_->fail(stage, message); }
void StreamSink::put_hierarchical(Volume const& volume) { writer_->put_hierarchical(volume); }
Traffic StreamSink::traffic() const { return writer_->traffic(); }
void StreamSink::report_stages(std::function<std::vector<StageReport>()> reports) { writer_->reports = std::move(reports); }

} // namespace vkt::ipc
