// Selection in groups: tables that are shared out, and voxels that are kept where they are fewer.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/grouped_quantiles.h"

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/core/type_dispatch.h"
#include "libvkt/operations/statistics/ordered_bits.h"

#include <algorithm>
#include <atomic>
#include <cstring>

namespace vkt {
namespace {

constexpr int most_bits = 16, least_bits = 4; ///< of a pass

[[noreturn]] void changed() { throw Error(ErrorKind::data, "the volume changed while it was read"); }

} // namespace

GroupedQuantiles::GroupedQuantiles(DataType type, std::vector<double> percents, std::vector<std::int64_t> finite)
    : type_(type), width_(static_cast<int>(8 * size_of(type))), percents_(std::move(percents)),
      finite_(std::move(finite)) {
    targets_.resize(finite_.size() * percents_.size() * 2);
    auto target = targets_.begin();
    for (std::int64_t const count : finite_)
        for (double const percent : percents_) {
            RankedPosition const at = count > 0 ? position_in(count, percent) : RankedPosition{};
            *target++ = {at.below, 0, count, count == 0};
            *target++ = {at.above, 0, count, count == 0};
            unfinished_ = unfinished_ || count > 0;
        }
}

std::size_t GroupedQuantiles::bytes_of_group(std::size_t percents) {
    return 16 + 2 * percents * (sizeof(Target) + sizeof(Class) + sizeof(std::int64_t));
}

/// One for every prefix that a target has whose voxel is not known yet.
void GroupedQuantiles::make_classes() {
    classes_.clear();
    first_class_.clear();
    std::size_t const each = 2 * percents_.size();
    for (std::size_t group = 0; group < finite_.size(); ++group) {
        auto const first = static_cast<std::ptrdiff_t>(classes_.size());
        first_class_.push_back(static_cast<std::uint32_t>(first));
        for (std::size_t t = group * each; t < (group + 1) * each; ++t) {
            Target const& target = targets_[t];
            bool const known = target.found || std::any_of(classes_.begin() + first, classes_.end(),
                                                           [&](Class const& c) { return c.prefix == target.prefix; });
            if (!known) classes_.push_back({target.prefix, target.voxels, 0, false});
        }
    }
    first_class_.push_back(static_cast<std::uint32_t>(classes_.size()));
}

/// What all classes need if a pass finds out so many bits.
GroupedQuantiles::Tables GroupedQuantiles::tables(int step) const {
    std::int64_t const most = std::int64_t{1} << step;
    Tables result;
    for (Class const& c : classes_) (c.voxels <= most ? result.kept : result.counters) += std::min(c.voxels, most);
    return result;
}

void GroupedQuantiles::begin_pass(std::size_t room, int threads) {
    make_classes();
    auto const fits = [&](int step, int by) { return tables(step).bytes(by) <= static_cast<double>(room); };
    int const rest = width_ - known_, most = std::min(rest, most_bits), least = std::min(rest, least_bits);
    threads_ = std::max(1, threads);
    // Threads are worth more than few passes, up to twice as many as there would be.
    for (step_ = most; step_ > std::max(most / 2, least) && !fits(step_, threads_);) --step_;
    if (!fits(step_, threads_)) {
        threads_ = 1;
        for (step_ = most; step_ > least && !fits(step_, 1);) --step_;
        if (!fits(step_, 1))
            throw Error(ErrorKind::resources,
                        text("percentiles of ", finite_.size(), " groups need ", bytes_text(tables(step_).bytes(1)),
                             " of memory, half of --memory leaves ", bytes_text(static_cast<double>(room))),
                        "raise --memory, or ask for fewer percentiles");
        while (threads_ < threads && fits(step_, threads_ + 1)) ++threads_;
    }
    Tables next;
    std::int64_t const bins = std::int64_t{1} << step_;
    for (Class& c : classes_) {
        c.keeps = c.voxels <= bins;
        std::int64_t& end = c.keeps ? next.kept : next.counters;
        c.at = end;
        end += std::min(c.voxels, bins);
    }
    counters_.assign(static_cast<std::size_t>(next.counters) * static_cast<std::size_t>(threads_), 0);
    kept_.resize(static_cast<std::size_t>(next.kept));
    arrived_.assign(classes_.size(), 0);
    in_pass_ = true;
}

void GroupedQuantiles::add(std::byte const* voxels, std::uint32_t const* groups, std::int64_t n, int thread) {
    std::size_t const each = counters_.size() / static_cast<std::size_t>(threads_);
    std::int64_t* const counters = counters_.data() + static_cast<std::size_t>(thread) * each;
    with_type(type_, [&]<class T>(T) { add_row(reinterpret_cast<T const*>(voxels), groups, n, counters); });
}

template <class T>
void GroupedQuantiles::add_row(T const* row, std::uint32_t const* groups, std::int64_t n, std::int64_t* counters) {
    QuantileClasses const classes = sought();
    for (std::int64_t i = 0; i < n; ++i) {
        std::uint32_t const group = groups[i];
        if (group == no_group || !is_finite_voxel(row[i])) continue;
        std::uint64_t const bits = ordered_bits(row[i]);
        std::uint32_t const k = classes.of(group, bits);
        if (k == QuantileClasses::none) continue;
        Class const& c = classes_[k];
        if (!c.keeps) {
            ++counters[c.at + classes.next(bits)];
            continue;
        }
        // They are sorted in the end.
        std::int64_t const place = std::atomic_ref<std::int64_t>(arrived_[k]).fetch_add(1, std::memory_order_relaxed);
        if (place < c.voxels) kept_[static_cast<std::size_t>(c.at + place)] = bits;
    }
}

namespace {

/// For a GPU, at least one of them.
template <class T> void put(std::vector<T> const& values, Buffer& to) {
    std::size_t const bytes = values.size() * sizeof(T);
    to.reserve(std::max(bytes, sizeof(T)));
    if (bytes > 0) std::memcpy(to.write(Space::host), values.data(), bytes);
}
void put_zeros(std::size_t count, Buffer& to) {
    to.reserve(std::max<std::size_t>(count, 1) * 8);
    device_clear(to.write(Space::device), to.bytes());
}
template <class Values> void get(Buffer& from, Values& to) {
    if (!to.empty()) copy_to_host(to.data(), from.read(Space::device), to.size() * sizeof to[0]);
}

} // namespace

void GroupedQuantiles::begin_on_device(std::vector<std::int64_t> const& keys) {
    device_ = std::make_shared<DeviceQuantiles>();
    DeviceQuantiles& d = *device_;
    put(classes_, d.classes);
    put(first_class_, d.first);
    put(keys, d.keys);
    put_zeros(counters_.size(), d.counters);
    put_zeros(kept_.size(), d.kept);
    put_zeros(arrived_.size(), d.arrived);
    d.groups = std::ssize(keys);
    d.contiguous =
        !keys.empty() && static_cast<std::uint64_t>(keys.back()) - static_cast<std::uint64_t>(keys.front()) ==
                             static_cast<std::uint64_t>(keys.size() - 1);
    d.width = width_;
    d.known = known_;
    d.step = step_;
}

void GroupedQuantiles::add(GroupedSlab const& slab, std::vector<std::int64_t> const& keys, Execution const& execution) {
    if (!device_) begin_on_device(keys);
    grouped_counts(slab, *device_, execution);
}

void GroupedQuantiles::end_on_device() {
    get(device_->counters, counters_);
    get(device_->kept, kept_);
    get(device_->arrived, arrived_);
    device_.reset();
}

/// What the pass found out about the targets of a group that lie in one of its classes.
void GroupedQuantiles::resolve(Class const& of, Target* targets, std::int64_t* counters) {
    auto const bins = static_cast<std::size_t>(1) << step_;
    auto* const kept = of.keeps ? kept_.data() + of.at : nullptr;
    if (of.keeps) {
        std::sort(kept, kept + of.voxels);
    } else {
        std::int64_t all = 0;
        for (std::size_t b = 0; b < bins; ++b) all += counters[of.at + static_cast<std::int64_t>(b)];
        if (all != of.voxels) changed();
    }
    for (std::size_t t = 0; t < 2 * percents_.size(); ++t) {
        Target& target = targets[t];
        // Those that were found in this pass have more bits than the class.
        if (target.found || target.voxels < 0 || target.prefix != of.prefix) continue;
        if (of.keeps) {
            target.prefix = kept[target.rank];
            target.found = true;
            continue;
        }
        std::size_t bin = 0;
        std::int64_t const* const counter = counters + of.at;
        while (target.rank >= counter[bin]) target.rank -= counter[bin++];
        target.prefix = target.prefix << step_ | bin;
        target.voxels = -counter[bin]; // negative: it has been dealt with
        target.found = known_ + step_ == width_;
    }
}

void GroupedQuantiles::end_pass() {
    if (device_) end_on_device();
    std::size_t const each = counters_.size() / static_cast<std::size_t>(threads_);
    for (int thread = 1; thread < threads_; ++thread)
        for (std::size_t b = 0; b < each; ++b) counters_[b] += counters_[static_cast<std::size_t>(thread) * each + b];
    for (std::size_t group = 0; group < finite_.size(); ++group) {
        Target* const targets = targets_.data() + group * 2 * percents_.size();
        for (std::uint32_t k = first_class_[group]; k < first_class_[group + 1]; ++k) {
            if (classes_[k].keeps && arrived_[k] != classes_[k].voxels) changed();
            resolve(classes_[k], targets, counters_.data());
        }
    }
    known_ += step_;
    unfinished_ = false;
    for (Target& target : targets_) {
        target.voxels = std::abs(target.voxels);
        unfinished_ = unfinished_ || !target.found;
    }
    in_pass_ = false;
    if (unfinished_) return;
    counters_ = {};
    kept_ = {};
    classes_ = {};
}

StoredValue GroupedQuantiles::percentile(std::size_t group, std::size_t i) const {
    Target const* const target = targets_.data() + (group * percents_.size() + i) * 2;
    return between(type_, stored_value(type_, target[0].prefix), stored_value(type_, target[1].prefix),
                   position_in(finite_[group], percents_[i]).share);
}

} // namespace vkt
