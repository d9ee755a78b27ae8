// Reading ahead: a thread walks the expected region slab by slab and keeps a few slabs ready.
// SPDX-License-Identifier: MIT
#include "libvkt/core/buffer.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/pipeline.h"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

namespace vkt {
namespace {

constexpr std::size_t slabs_ahead = 3;

struct Slab {
    Box box;
    Buffer voxels;
};

/// Serves slabs of the expected region that were read ahead; anything else goes to the source itself.
class Prefetch : public SourceDecorator {
public:
    Prefetch(std::unique_ptr<Source> source, Execution execution)
        : SourceDecorator(std::move(source)), execution_(std::move(execution)) {}
    ~Prefetch() override { stop(); }

    bool next_volume() override {
        stop();
        return inner().next_volume();
    }
    void expect(Box const& region) override {
        stop();
        inner().expect(region);
        if (region.empty()) return;
        region_ = region;
        height_ = slab_height(inner().header(), 0, execution_);
        if (region.dims().z <= height_) return; // one read is all there is
        start();
    }
    std::int64_t natural_slab() const override { return inner().natural_slab(); }

    std::optional<ConstView> borrow(Box const& region) override {
        Slab const* const slab = slab_with(region);
        if (slab == nullptr || !slab->box.contains(region)) return std::nullopt;
        return view_of(*slab).part(region);
    }
    void read(AnyView out) override {
        Box rest = out.box;
        while (!rest.empty()) {
            Slab const* const slab = slab_with(rest);
            if (slab == nullptr) {
                stop(); // not what was expected: the source answers directly from here on
                return inner().read(out.part(rest));
            }
            Box part = rest;
            part.upper.z = std::min(slab->box.upper.z, rest.upper.z);
            copy(view_of(*slab).part(part), out.part(part));
            rest.lower.z = part.upper.z;
        }
    }
    void finish() override {
        stop();
        inner().finish();
    }

private:
    ConstView view_of(Slab const& slab) const {
        return dense_view(const_cast<Buffer&>(slab.voxels).read(Space::host), inner().header().dtype, slab.box);
    }

    /// The slab that holds the first slice of a region within its columns, waiting for it; null if it will not come.
    Slab const* slab_with(Box const& region) {
        if (!thread_.joinable() || region.lower.z > served_z_ + height_)
            return nullptr; // a jump: not worth reading up to it
        std::unique_lock lock(mutex_);
        while (true) {
            while (!ready_.empty() && ready_.front().box.upper.z <= region.lower.z) {
                spare_.push_back(std::move(ready_.front()));
                ready_.pop_front();
                changed_.notify_all();
            }
            if (!ready_.empty()) {
                Box const& box = ready_.front().box;
                bool const columns = region.lower.x >= box.lower.x && region.upper.x <= box.upper.x &&
                                     region.lower.y >= box.lower.y && region.upper.y <= box.upper.y;
                served_z_ = std::max(served_z_, box.upper.z);
                return columns && region.lower.z >= box.lower.z ? &ready_.front() : nullptr;
            }
            if (failure_) std::rethrow_exception(failure_);
            if (complete_) return nullptr;
            changed_.wait(lock);
        }
    }

    void start() {
        served_z_ = region_.lower.z;
        complete_ = cancel_ = false;
        failure_ = nullptr;
        thread_ = std::thread([this] {
            try {
                for (std::int64_t z = region_.lower.z; z < region_.upper.z && read_slab(z); z += height_) {
                }
            } catch (...) {
                std::lock_guard const lock(mutex_);
                failure_ = std::current_exception();
            }
            std::lock_guard const lock(mutex_);
            complete_ = true;
            changed_.notify_all();
        });
    }

    bool read_slab(std::int64_t z) {
        Slab slab;
        {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [&] { return cancel_ || ready_.size() < slabs_ahead; });
            if (cancel_) return false;
            if (!spare_.empty()) {
                slab = std::move(spare_.back());
                spare_.pop_back();
            }
        }
        slab.box = region_;
        slab.box.lower.z = z;
        slab.box.upper.z = std::min(z + height_, region_.upper.z);
        DataType const type = inner().header().dtype;
        slab.voxels.reserve(static_cast<std::size_t>(slab.box.voxels()) * size_of(type));
        inner().read(dense_view(slab.voxels.write(Space::host), type, slab.box));
        std::lock_guard const lock(mutex_);
        ready_.push_back(std::move(slab));
        changed_.notify_all();
        return true;
    }

    void stop() {
        if (!thread_.joinable()) return;
        {
            std::lock_guard const lock(mutex_);
            cancel_ = true;
            changed_.notify_all();
        }
        thread_.join();
        while (!ready_.empty()) {
            spare_.push_back(std::move(ready_.front()));
            ready_.pop_front();
        }
    }

    Execution execution_;
    Box region_;
    std::int64_t height_ = 1;
    std::int64_t served_z_ = 0;
    std::thread thread_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Slab> ready_, spare_;
    bool complete_ = false, cancel_ = false;
    std::exception_ptr failure_;
};

} // namespace

std::unique_ptr<Source> prefetch(std::unique_ptr<Source> source, Execution const& execution) {
    return std::make_unique<Prefetch>(std::move(source), execution);
}

} // namespace vkt
