// Two slabs: one is computed while the other is written.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/slab_sink.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"

#include <array>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

namespace vkt {

namespace {

class SlabSink : public Sink {
public:
    explicit SlabSink(std::unique_ptr<VolumeWriter> writer) : writer_(std::move(writer)) {}
    ~SlabSink() override { stop(); }
    SlabSink(SlabSink const&) = delete;
    SlabSink& operator=(SlabSink const&) = delete;

    void begin(Header const& header) override;
    AnyView acquire(Box const& slab) override;
    void commit() override;
    void end() override;
    void close() override;
    void plan(Header const& header) override { writer_->plan(header); }

private:
    static constexpr std::size_t ring = 2;
    struct Slot {
        Buffer buffer;
        std::byte* data = nullptr;
        std::size_t bytes = 0;
    };

    void write_all();
    void wait_until_written(std::size_t pending);
    void stop();

    std::unique_ptr<VolumeWriter> writer_;
    Header header_;
    PieceOrder order_; ///< of what was acquired
    bool acquired_ = false, open_ = false;
    std::array<Slot, ring> slots_;
    std::size_t filled_ = 0, written_ = 0; ///< slabs since the beginning; their difference is what is pending

    std::thread thread_; ///< started when a volume turns out to have more than one slab
    std::mutex mutex_;
    std::condition_variable changed_;
    bool stopping_ = false;
    std::exception_ptr failure_;
};

void SlabSink::begin(Header const& header) {
    if (open_) throw Error(ErrorKind::failure, "a volume was begun before the last one ended");
    check(header);
    header_ = header;
    order_ = PieceOrder(header_.dims);
    writer_->begin(header_);
    open_ = true;
}

AnyView SlabSink::acquire(Box const& slab) {
    if (!open_ || acquired_ || !order_.takes(slab))
        throw Error(ErrorKind::failure, text("slab ", slab, " is out of order"));
    wait_until_written(ring - 1);
    Slot& slot = slots_[filled_ % ring];
    slot.bytes = static_cast<std::size_t>(slab.voxels()) * size_of(header_.dtype);
    slot.buffer.reserve(slot.bytes);
    slot.data = slot.buffer.write(Space::host);
    order_.advance(slab);
    acquired_ = true;
    return dense_view(slot.data, header_.dtype, slab);
}

void SlabSink::commit() {
    if (!acquired_) throw Error(ErrorKind::failure, "a slab was committed that was not acquired");
    acquired_ = false;
    if (!thread_.joinable()) {
        if (order_.complete()) {
            // The only slab: nothing to overlap with.
            Slot const& slot = slots_[filled_ % ring];
            writer_->write(slot.data, slot.bytes);
            return;
        }
        thread_ = std::thread([this] { write_all(); });
    }
    {
        std::lock_guard const lock(mutex_);
        ++filled_;
    }
    changed_.notify_all();
}

void SlabSink::end() {
    if (!open_ || acquired_ || !order_.complete())
        throw Error(ErrorKind::failure,
                    text("the volume ended after ", order_.slices(), " of ", header_.dims.z, " slices"));
    wait_until_written(0);
    writer_->end();
    open_ = false;
}

void SlabSink::close() {
    if (open_) throw Error(ErrorKind::failure, "the output was closed before its volume ended");
    wait_until_written(0);
    stop();
    writer_->close();
}

/// Waits until at most `pending` slabs are left to write; passes on what went wrong with an earlier one.
void SlabSink::wait_until_written(std::size_t pending) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return failure_ || filled_ - written_ <= pending; });
    if (failure_) std::rethrow_exception(failure_);
}

void SlabSink::write_all() {
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [&] { return stopping_ || filled_ > written_; });
        if (stopping_) return;
        Slot const& slot = slots_[written_ % ring];
        lock.unlock();
        try {
            writer_->write(slot.data, slot.bytes);
        } catch (...) {
            lock.lock();
            failure_ = std::current_exception();
            changed_.notify_all();
            return;
        }
        lock.lock();
        ++written_;
        changed_.notify_all();
    }
}

void SlabSink::stop() {
    if (!thread_.joinable()) return;
    {
        std::lock_guard const lock(mutex_);
        stopping_ = true;
    }
    changed_.notify_all();
    thread_.join();
    stopping_ = false;
}

} // namespace

std::unique_ptr<Sink> slab_sink(std::unique_ptr<VolumeWriter> writer) {
    return std::make_unique<SlabSink>(std::move(writer));
}

} // namespace vkt
