// Shares of a pipeline: threads, slabs in turn, and counters that add up.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/divided.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/spool.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

namespace vkt {
namespace {

/// Slabs of a share, at least: what is read around them is read by two shares, so that few thick ones are best, but
/// nothing is handed on before the first is done.
constexpr std::int64_t slabs_of_share = 2;
/// That a share computes before the first is asked for.
constexpr std::size_t slabs_a_share = 2;

class Divided : public Source {
public:
    Divided(std::vector<Share> shares, Execution execution)
        : shares_(std::move(shares)), execution_(std::move(execution)) {}
    ~Divided() override { stop(); }

    bool next_volume() override {
        stop();
        bool const more = first().next_volume();
        if (more && shares_.size() > 1 && !first().header().dry_run) {
            if (header().kind != Kind::structured || header().dims.z < slices_needed() || !first().divisible(true))
                shares_.resize(1);
        }
        for (std::size_t i = 1; i < shares_.size() && !planned_only(more); ++i)
            if (shares_[i].source->next_volume() != more)
                throw Error(ErrorKind::data, "the input changed while several GPUs read it");
        whole_ = {};
        return more;
    }
    Header const& header() const override { return first().header(); }
    Access access() const override { return together() ? Access::forward : first().access(); }
    Space space() const override { return together() ? Space::host : first().space(); }
    std::int64_t natural_slab() const override { return first().natural_slab(); }
    std::optional<ConstView> borrow(Box const& region) override {
        return together() ? std::nullopt : first().borrow(region);
    }
    std::shared_ptr<Lease> lease(Box const& region) override { return together() ? nullptr : first().lease(region); }
    BrickSequence take_bricks() override { return first().take_bricks(); }
    std::vector<std::string> not_read() const override { return first().not_read(); }
    std::int64_t parts_to_come() const override { return first().parts_to_come(); }
    bool divisible(bool ascending) const override { return !together() && first().divisible(ascending); }

    void expect(Box const& region) override {
        if (!together()) return first().expect(region);
        stop();
        if (!region.empty()) start(region);
    }
    void read(AnyView out) override {
        if (!together()) return first().read(out);
        if (out.box.empty()) return;
        if (threads_.empty()) start(box_of(header().dims));
        for (Box rest = out.box; rest.lower.z < rest.upper.z;) {
            Slab const& slab = slab_with(rest.lower.z);
            Box part = rest;
            part.upper.z = std::min(rest.upper.z, slab.box.upper.z);
            copy_region(view_of(slab).part(part), out.part(part), execution_);
            rest.lower.z = part.upper.z;
        }
    }
    void finish() override {
        stop();
        if (failure_) std::rethrow_exception(failure_);
        if (together())
            for (std::size_t i = 1; i < shares_.size(); ++i) {
                shares_[i].source->finish();
                add_counters(shares_[i].operations);
            }
        first().finish();
    }

private:
    struct Slab {
        Box box;
        Buffer voxels;
    };

    Source& first() const { return *shares_.front().source; }
    bool together() const { return shares_.size() > 1 && !first().header().dry_run; }
    bool planned_only(bool more) const { return more && first().header().dry_run; }
    std::int64_t slices_needed() const { return 2 * static_cast<std::int64_t>(shares_.size()); }

    void add_counters(std::vector<Operation*> const& operations) {
        for (std::size_t i = 0; i < operations.size(); ++i) {
            auto const to = shares_.front().operations[i]->counters(), from = operations[i]->counters();
            for (std::size_t k = 0; k < to.size(); ++k) *to[k] += *from[k];
            shares_.front().operations[i]->computed += operations[i]->computed;
        }
    }

    ConstView view_of(Slab const& slab) const {
        return dense_view(const_cast<Buffer&>(slab.voxels).read(Space::host), header().dtype, slab.box);
    }

    void start(Box const& region) {
        whole_ = region;
        auto const count = static_cast<std::int64_t>(shares_.size());
        std::size_t const slice = static_cast<std::size_t>(region.dims().x * region.dims().y) * size_of(header().dtype);
        auto const most = static_cast<std::int64_t>(execution_.memory / 2 / (slabs_a_share * shares_.size() * slice));
        std::int64_t const all = slabs_of_share * count;
        height_ = std::clamp<std::int64_t>(most, 1, (region.dims().z + all - 1) / all);
        taken_ = 0;
        cancel_ = false;
        failure_ = nullptr;
        slabs_.clear();
        for (std::size_t i = 0; i < shares_.size(); ++i) threads_.emplace_back([this, i] { work(i); });
    }

    Box box_of_slab(std::int64_t number) const {
        Box box = whole_;
        box.lower.z = std::min(whole_.lower.z + number * height_, whole_.upper.z);
        box.upper.z = std::min(box.lower.z + height_, whole_.upper.z);
        return box;
    }

    /// Every so many slabs are one share's.
    void work(std::size_t share) {
        auto const count = static_cast<std::int64_t>(shares_.size());
        try {
            for (auto number = static_cast<std::int64_t>(share);; number += count) {
                Slab slab{box_of_slab(number), {}};
                if (slab.box.empty() || !may_begin(number, slab.voxels)) return;
                compute(*shares_[share].source, slab);
                std::lock_guard const lock(mutex_);
                slabs_.emplace_back(number, std::move(slab));
                changed_.notify_all();
            }
        } catch (...) {
            std::lock_guard const lock(mutex_);
            if (!failure_) failure_ = std::current_exception();
            changed_.notify_all();
        }
    }

    void compute(Source& source, Slab& slab) const {
        Box const& box = slab.box;
        std::int64_t const begin = box.lower.z == whole_.lower.z ? 0 : box.lower.z;
        source.count_only(begin, box.upper.z == whole_.upper.z ? header().dims.z : box.upper.z);
        source.expect(box);
        slab.voxels.reserve(static_cast<std::size_t>(box.voxels()) * size_of(header().dtype));
        source.read(dense_view(slab.voxels.write(Space::host), header().dtype, box));
    }

    /// Waits until slabs before it were taken, and takes the memory of one of them. False if it is not wanted any more.
    bool may_begin(std::int64_t number, Buffer& memory) {
        auto const most = static_cast<std::int64_t>(slabs_a_share * shares_.size());
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return cancel_ || failure_ || number < taken_ + most; });
        if (cancel_ || failure_) return false;
        if (!spare_.empty()) {
            memory = std::move(spare_.back());
            spare_.pop_back();
        }
        return true;
    }

    /// The slab that holds a slice, when it is there. Those before it are not asked for again.
    Slab const& slab_with(std::int64_t z) {
        std::int64_t const number = (z - whole_.lower.z) / height_;
        std::unique_lock lock(mutex_);
        taken_ = std::max(taken_, number);
        std::erase_if(slabs_, [&](auto& known) {
            if (known.first >= taken_) return false;
            spare_.push_back(std::move(known.second.voxels));
            return true;
        });
        changed_.notify_all();
        Slab const* found = nullptr;
        changed_.wait(lock, [&] {
            for (auto const& known : slabs_)
                if (known.first == number) found = &known.second;
            return found != nullptr || failure_;
        });
        if (found == nullptr) std::rethrow_exception(failure_);
        return *found;
    }

    void stop() {
        {
            std::lock_guard const lock(mutex_);
            cancel_ = true;
            changed_.notify_all();
        }
        for (auto& thread : threads_) thread.join();
        threads_.clear();
    }

    std::vector<Share> shares_;
    Execution execution_;
    Box whole_; ///< what is asked for
    std::int64_t height_ = 1;
    std::vector<std::thread> threads_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::pair<std::int64_t, Slab>> slabs_; ///< computed, with their numbers; a deque leaves them in place
    std::vector<Buffer> spare_;
    std::int64_t taken_ = 0; ///< slabs before this one were asked for
    bool cancel_ = false;
    std::exception_ptr failure_;
};

} // namespace

std::unique_ptr<Source> divided(std::vector<Share> shares, Execution const& execution) {
    return std::make_unique<Divided>(std::move(shares), execution);
}

Execution share_of(Execution execution, int shares) {
    execution.threads = std::max(1, execution.threads / shares);
    execution.memory /= 2 * static_cast<std::size_t>(shares); // the other half holds results
    execution.gpus = 1;
    return execution;
}

struct SharedInput::State {
    std::unique_ptr<Source> source;
    Execution execution;
    std::mutex mutex;
    std::int64_t number = 0; ///< of the current volume, from 1
    bool more = true, finished = false;
    std::unique_ptr<Spool> spool;
};

class SharedInput::Reader : public Source {
public:
    explicit Reader(std::shared_ptr<State> state) : state_(std::move(state)) {}

    bool next_volume() override {
        std::lock_guard const lock(state_->mutex);
        if (++number_ > state_->number) {
            state_->number = number_;
            state_->spool.reset();
            state_->finished = false;
            state_->more = state_->source->next_volume();
        }
        kept_ = state_.use_count() > 1 && state_->more && header().kind == Kind::structured && !header().dry_run;
        return state_->more;
    }
    Header const& header() const override { return state_->source->header(); }
    Access access() const override { return kept_ ? Access::random : state_->source->access(); }
    Space space() const override { return kept_ ? Space::host : state_->source->space(); }
    void read(AnyView out) override {
        if (!kept_) return state_->source->read(out);
        std::lock_guard const lock(state_->mutex);
        keep();
        state_->spool->read(out);
    }
    std::optional<ConstView> borrow(Box const& region) override {
        if (!kept_) return state_->source->borrow(region);
        std::lock_guard const lock(state_->mutex);
        return state_->spool ? state_->spool->borrow(region) : std::nullopt;
    }
    std::shared_ptr<Lease> lease(Box const& region) override { return kept_ ? nullptr : state_->source->lease(region); }
    BrickSequence take_bricks() override { return state_->source->take_bricks(); }
    std::vector<std::string> not_read() const override { return state_->source->not_read(); }
    std::int64_t parts_to_come() const override { return state_->source->parts_to_come(); }
    void expect(Box const& region) override {
        if (!kept_) state_->source->expect(region);
    }
    std::int64_t natural_slab() const override { return state_->source->natural_slab(); }
    void finish() override {
        std::lock_guard const lock(state_->mutex);
        if (!std::exchange(state_->finished, true) && !state_->spool) state_->source->finish();
    }

private:
    void keep() {
        if (state_->spool) return;
        std::size_t const in_memory = state_->execution.memory / 4;
        auto spool = std::make_unique<Spool>(header(), in_memory, state_->execution, StageInfo{});
        spool->fill(*state_->source, state_->execution);
        state_->spool = std::move(spool);
    }

    std::shared_ptr<State> state_;
    std::int64_t number_ = 0;
    bool kept_ = false;
};

SharedInput::SharedInput(std::unique_ptr<Source> source, Execution const& execution)
    : state_(std::make_shared<State>()) {
    state_->source = std::move(source);
    state_->execution = execution;
}

SharedInput::~SharedInput() = default;

std::unique_ptr<Source> SharedInput::reader() { return std::make_unique<Reader>(state_); }

} // namespace vkt
