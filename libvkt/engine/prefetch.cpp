// Reading ahead: a thread walks the expected region slab by slab and keeps a few slabs ready.
// SPDX-License-Identifier: MIT
#include "libvkt/core/buffer.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/pipeline.h"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

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
    /// Reading starts when the first voxels are asked for: what was read ahead is lost if another region is expected,
    /// and a source that only goes forward cannot read it again.
    void expect(Box const& region) override {
        stop();
        inner().expect(region);
        if (region.empty()) return;
        region_ = region;
        Header part = inner().header();
        part.dims.x = region.dims().x;
        part.dims.y = region.dims().y;
        cut_ = cut_of(part, slab_hint_on(execution_, part, 0), execution_);
        served_z_ = region_.lower.z;
        expects_ = region.dims().z > cut_.slices || region.dims().y > cut_.rows; // else one read is all there is
    }
    std::int64_t natural_slab() const override { return inner().natural_slab(); }

    std::optional<ConstView> borrow(Box const& region) override {
        Slab const* const slab = slab_with(region);
        if (slab == nullptr || !slab->box.contains(region)) return std::nullopt;
        return view_of(*slab).part(region);
    }
    void read(AnyView out) override {
        for_each_part(out.box, [&](Box const& rest) {
            Slab const* const slab = slab_with(rest);
            if (slab == nullptr) {
                stop(); // not what was expected: the source answers directly from here on
                inner().read(out.part(rest));
                return rest;
            }
            Box const part = first_part(rest, slab->box);
            copy(view_of(*slab).part(part), out.part(part));
            return part;
        });
    }
    void finish() override {
        stop();
        inner().finish();
    }

private:
    ConstView view_of(Slab const& slab) const {
        return dense_view(const_cast<Buffer&>(slab.voxels).read(Space::host), inner().header().dtype, slab.box);
    }

    /// True if a slab lies before the first voxels of a region.
    bool is_passed(Box const& slab, Box const& region) const {
        if (slab.upper.z <= region.lower.z) return true;
        bool const rows = slab.upper.y < region_.upper.y; // the next piece has others of this slice
        return rows && slab.lower.z == region.lower.z && slab.upper.y <= region.lower.y;
    }

    /// The slab that holds the first row of a region and its columns, waiting for it; null if it will not come.
    Slab const* slab_with(Box const& region) {
        // A jump is not worth reading up to it, unless all that lies before is read anyway, or was read ahead already.
        if (region.lower.z > served_z_ + cut_.slices && inner().access() == Access::random) return nullptr;
        if (std::exchange(expects_, false)) start();
        if (!thread_.joinable()) return nullptr;
        std::unique_lock lock(mutex_);
        while (true) {
            while (!ready_.empty() && is_passed(ready_.front().box, region)) {
                spare_.push_back(std::move(ready_.front()));
                ready_.pop_front();
                changed_.notify_all();
            }
            if (!ready_.empty()) {
                Box const& box = ready_.front().box;
                bool const columns = region.lower.x >= box.lower.x && region.upper.x <= box.upper.x &&
                                     region.lower.y >= region_.lower.y && region.upper.y <= region_.upper.y;
                served_z_ = std::max(served_z_, box.upper.z);
                bool const begun = region.lower.z >= box.lower.z && region.lower.y >= box.lower.y;
                return columns && begun ? &ready_.front() : nullptr;
            }
            if (failure_) std::rethrow_exception(failure_);
            if (complete_) return nullptr;
            changed_.wait(lock);
        }
    }

    void start() {
        complete_ = cancel_ = false;
        failure_ = nullptr;
        thread_ = std::thread([this] {
            try {
                bool wanted = true;
                for_each_piece(region_, cut_, [&](Box const& box) { wanted = wanted && read_slab(box); });
            } catch (...) {
                std::lock_guard const lock(mutex_);
                failure_ = std::current_exception();
            }
            std::lock_guard const lock(mutex_);
            complete_ = true;
            changed_.notify_all();
        });
    }

    bool read_slab(Box const& box) {
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
        slab.box = box;
        DataType const type = inner().header().dtype;
        slab.voxels.reserve(static_cast<std::size_t>(slab.box.voxels()) * size_of(type));
        inner().read(dense_view(slab.voxels.write(Space::host), type, slab.box));
        std::lock_guard const lock(mutex_);
        ready_.push_back(std::move(slab));
        changed_.notify_all();
        return true;
    }

    void stop() {
        expects_ = false;
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
    Cut cut_;
    std::int64_t served_z_ = 0;
    std::thread thread_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Slab> ready_, spare_;
    bool expects_ = false; ///< a region that is read ahead once it is asked for
    bool complete_ = false, cancel_ = false;
    std::exception_ptr failure_;
};

} // namespace

std::unique_ptr<Source> prefetch(std::unique_ptr<Source> source, Execution const& execution) {
    return std::make_unique<Prefetch>(std::move(source), execution);
}

} // namespace vkt
