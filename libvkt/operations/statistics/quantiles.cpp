// Selection by ordered patterns, 16 bits at a time.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/quantiles.h"

#include "libvkt/core/error.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/kernel/host_copy.h"
#include "libvkt/operations/statistics/kernels/ordered_counts.h"
#include "libvkt/operations/statistics/ordered_bits.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <omp.h>
#include <type_traits>

namespace vkt {
namespace {

/// Voxels that are kept, from the beginning or when their classes are known: no more memory than counters take.
constexpr std::int64_t most_collected = std::int64_t{1} << 18;
constexpr std::size_t bins = 65536;
constexpr int most_threads = 16;
constexpr std::int64_t piece = 65536; ///< of a row, that a thread takes

} // namespace

Quantiles::Quantiles(DataType type, std::vector<double> percents, std::int64_t voxels)
    : type_(type), width_(static_cast<int>(8 * size_of(type))), percents_(std::move(percents)) {
    collects_ = width_ > 16 && voxels <= most_collected;
    targets_.resize(2 * percents_.size());
    begin_pass();
}

std::size_t Quantiles::state_bytes(DataType type, int threads) {
    auto const sharers = static_cast<std::size_t>(std::min(threads, most_threads));
    std::size_t const bits = 8 * size_of(type);
    if (bits <= 16) return sharers * sizeof(std::int64_t) << bits; // all values are counted in one pass
    return std::max(sharers * 4 * bins * sizeof(std::int64_t),
                    static_cast<std::size_t>(most_collected) * sizeof(std::uint64_t));
}

OrderedClasses Quantiles::classes() const {
    return {type_, known_, static_cast<int>(prefixes_.size()), prefixes_.data()};
}

Quantiles::Share Quantiles::empty_share() const {
    Share share;
    if (collects_)
        share.keys.resize(prefixes_.size());
    else
        share.counters = VoxelCounts(classes().counters() * prefixes_.size());
    return share;
}

/// A class for every prefix that a target has.
void Quantiles::begin_pass() {
    prefixes_.clear();
    for (Target const& target : targets_)
        if (std::find(prefixes_.begin(), prefixes_.end(), target.prefix) == prefixes_.end())
            prefixes_.push_back(target.prefix);
    shares_.clear();
    shares_.push_back(empty_share());
}

void Quantiles::add(ConstView slab, Execution const& execution) {
    on_device_ = on_device_ || slab.space == Space::device;
    auto const fitting = static_cast<std::int64_t>(execution.memory / (8 * state_bytes(type_, 1)));
    auto const useful = std::min<std::int64_t>({slab.box.voxels() / 65536, fitting, execution.threads, most_threads});
    int threads = static_cast<int>(std::max<std::int64_t>(useful, 1));
    if (on_device_) threads = 1;
    while (shares_.size() < static_cast<std::size_t>(threads))
        shares_.push_back(empty_share()); // later ones are larger
    if (!collects_) return add_counts(slab, threads, execution);
    HostCopy copy; // of a small volume
    add_keys(copy.of(slab), threads);
}

void Quantiles::add_counts(ConstView slab, int threads, Execution const& execution) {
    std::vector<std::uint64_t*> sets;
    for (int t = 0; t < threads; ++t)
        sets.push_back(shares_[static_cast<std::size_t>(t)].counters.update(execution.space()));
    count_ordered(slab, classes(), sets.data(), threads, execution);
}

void Quantiles::add_keys(ConstView slab, int threads) {
    Index3 const n = slab.dims();
    std::int64_t const pieces = (n.x + piece - 1) / piece;
    FirstFailure failure; // they may find no memory
    with_type(type_, [&]<class T>(T) {
        View<T const> const in = slab.as<T>();
        Box const box = slab.box;
#pragma omp parallel for num_threads(threads) schedule(static) if (threads > 1)
        for (std::int64_t i = 0; i < pieces * n.y * n.z; ++i)
            failure.catch_from([&] {
                std::int64_t const x = i % pieces * piece, y = i / pieces % n.y, z = i / pieces / n.y;
                add_keys_of(&in(box.lower.x + x, box.lower.y + y, box.lower.z + z), std::min(piece, n.x - x),
                            shares_[static_cast<std::size_t>(threads > 1 ? omp_get_thread_num() : 0)]);
            });
    });
    failure.rethrow();
}

template <class T> void Quantiles::add_keys_of(T const* row, std::int64_t n, Share& share) const {
    int const rest = width_ - known_;
    for (std::int64_t i = 0; i < n; ++i) {
        if (!is_finite_voxel(row[i])) continue;
        std::uint64_t const key = ordered_bits(row[i]), prefix = known_ == 0 ? 0 : key >> rest;
        for (std::size_t c = 0; c < prefixes_.size(); ++c)
            if (prefixes_[c] == prefix) share.keys[c].push_back(key);
    }
}

/// What all threads counted of a class.
std::vector<std::uint64_t> Quantiles::counters_of(std::size_t c) {
    std::size_t const each = classes().counters();
    std::vector<std::uint64_t> result(each - 1);
    for (Share& share : shares_) {
        auto const own = share.counters.read().subspan(c * each, each - 1);
        for (std::size_t bin = 0; bin < own.size(); ++bin) result[bin] += own[bin];
    }
    return result;
}

/// What all threads kept of a class, in order.
std::vector<std::uint64_t> Quantiles::keys_of(std::size_t c) const {
    std::vector<std::uint64_t> result;
    for (Share const& share : shares_) result.insert(result.end(), share.keys[c].begin(), share.keys[c].end());
    std::sort(result.begin(), result.end());
    return result;
}

void Quantiles::place_targets(std::int64_t count) {
    count_ = count;
    for (std::size_t i = 0; i < percents_.size() && count_ > 0; ++i) {
        RankedPosition const at = position_in(count_, percents_[i]);
        targets_[2 * i].rank = at.below;
        targets_[2 * i + 1].rank = at.above;
    }
}

bool Quantiles::end_pass() {
    int const step = classes().next();
    std::vector<Target> const before = targets_;
    for (std::size_t c = 0; c < prefixes_.size(); ++c) {
        std::vector<std::uint64_t> const all = collects_ ? keys_of(c) : counters_of(c);
        if (known_ == 0) { // there is one class, of all voxels
            place_targets(static_cast<std::int64_t>(
                collects_ ? all.size() : std::accumulate(all.begin(), all.end(), std::uint64_t{0})));
            if (count_ == 0) return false;
        }
        for (std::size_t t = 0; t < targets_.size(); ++t) {
            if (before[t].prefix != prefixes_[c]) continue;
            Target& target = targets_[t];
            if (collects_) {
                // A file that changes between two passes may lack what was counted.
                if (all.empty()) throw Error(ErrorKind::data, "the volume changed while it was read");
                target.prefix = all[std::min(static_cast<std::size_t>(target.rank), all.size() - 1)];
                continue;
            }
            std::size_t bin = 0;
            for (; bin + 1 < all.size() && target.rank >= static_cast<std::int64_t>(all[bin]); ++bin)
                target.rank -= static_cast<std::int64_t>(all[bin]);
            target.prefix = target.prefix << step | bin;
            target.voxels = static_cast<std::int64_t>(all[bin]);
        }
    }
    known_ = collects_ ? width_ : known_ + step;
    shares_.clear();
    if (known_ == width_) return false;
    std::int64_t voxels = 0; // some may be counted twice
    for (Target const& target : targets_) voxels += target.voxels;
    collects_ = voxels <= most_collected && !on_device_;
    begin_pass();
    return true;
}

StoredValue stored_value(DataType type, std::uint64_t bits) {
    StoredValue result;
    with_type(type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T> && sizeof(T) == 8)
            result.whole = value_of_ordered<T>(bits);
        else
            result.rest = static_cast<double>(value_of_ordered<T>(bits));
    });
    return result;
}

RankedPosition position_in(std::int64_t count, double percent) {
    double const position = percent / 100 * static_cast<double>(count - 1);
    auto const rank = std::clamp<std::int64_t>(static_cast<std::int64_t>(position), 0, count - 1);
    return {rank, std::min(rank + 1, count - 1), position - std::floor(position)};
}

StoredValue between(DataType type, StoredValue const& below, StoredValue const& above, double share) {
    if (share == 0) return below;
    if (is_integer(type)) return {below.whole, below.rest + share * (above - below)};
    return {0, std::lerp(below.rest, above.rest, share)};
}

StoredValue Quantiles::percentile(std::size_t i) const {
    return between(type_, stored_value(type_, targets_[2 * i].prefix), stored_value(type_, targets_[2 * i + 1].prefix),
                   position_in(count_, percents_[i]).share);
}

} // namespace vkt
