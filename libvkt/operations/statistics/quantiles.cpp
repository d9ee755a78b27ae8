// Selection by ordered patterns, 16 bits at a time.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/quantiles.h"

#include "libvkt/core/error.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/ordered_bits.h"

#include <algorithm>
#include <cmath>
#include <omp.h>
#include <type_traits>

namespace vkt {
namespace {

/// Voxels that are kept, from the beginning or when their classes are known: no more memory than counters take.
constexpr std::int64_t most_collected = std::int64_t{1} << 18;
constexpr std::size_t bins = 65536;
constexpr int most_threads = 16;

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

/// Every thread begins with empty classes, one for every prefix that a target has.
void Quantiles::begin_pass() {
    Share share;
    for (Target const& target : targets_) {
        bool const is_new = std::none_of(share.classes.begin(), share.classes.end(),
                                         [&](Class const& c) { return c.prefix == target.prefix; });
        if (is_new) share.classes.push_back({target.prefix, {}, {}});
    }
    if (!collects_)
        for (Class& c : share.classes) c.counters.resize(std::size_t{1} << std::min(width_, 16));
    shares_.assign(1, share);
}

void Quantiles::add(ConstView slab, int threads) {
    with_type(type_, [&]<class T>(T) { add_rows<T>(slab, threads); });
}

template <class T> void Quantiles::add_rows(ConstView slab, int threads) {
    View<T const> const in = slab.as<T>();
    Box const box = slab.box;
    Index3 const n = box.dims();
    threads = static_cast<int>(std::clamp<std::int64_t>(box.voxels() / 65536, 1, std::clamp(threads, 1, most_threads)));
    while (shares_.size() < static_cast<std::size_t>(threads)) { // later slabs may be larger
        Share share = shares_.front();
        for (Class& c : share.classes) {
            std::fill(c.counters.begin(), c.counters.end(), 0);
            c.keys.clear();
        }
        share.finite = 0;
        shares_.push_back(std::move(share));
    }
    constexpr std::int64_t piece = 65536;
    std::int64_t const pieces = (n.x + piece - 1) / piece;
    FirstFailure failure; // keys that are collected may find no memory
#pragma omp parallel for num_threads(threads) schedule(static) if (threads > 1)
    for (std::int64_t i = 0; i < pieces * n.y * n.z; ++i)
        failure.catch_from([&] {
            std::int64_t const x = i % pieces * piece, y = i / pieces % n.y, z = i / pieces / n.y;
            add_row(&in(box.lower.x + x, box.lower.y + y, box.lower.z + z), std::min(piece, n.x - x),
                    shares_[static_cast<std::size_t>(threads > 1 ? omp_get_thread_num() : 0)]);
        });
    failure.rethrow();
}

template <class T> void Quantiles::add_row(T const* row, std::int64_t n, Share& share) const {
    constexpr int bits = static_cast<int>(8 * sizeof(T));
    std::int64_t finite = 0;
    if (known_ == 0 && !collects_) { // all belong to the one class there is
        std::int64_t* const counters = share.classes.front().counters.data();
        for (std::int64_t i = 0; i < n; ++i) {
            if (!is_finite_voxel(row[i])) continue;
            ++finite;
            ++counters[ordered_bits(row[i]) >> std::max(bits - 16, 0)];
        }
    } else {
        int const rest = bits - known_, left = std::max(rest - 16, 0);
        for (std::int64_t i = 0; i < n; ++i) {
            if (!is_finite_voxel(row[i])) continue;
            ++finite;
            std::uint64_t const key = ordered_bits(row[i]), prefix = known_ == 0 ? 0 : key >> rest;
            for (Class& c : share.classes) {
                if (c.prefix != prefix) continue;
                if (collects_)
                    c.keys.push_back(key);
                else
                    ++c.counters[key >> left & (bins - 1)];
            }
        }
    }
    share.finite += finite;
}

/// What all threads saw of a class.
Quantiles::Class Quantiles::merged(std::size_t i) const {
    Class result = shares_.front().classes[i];
    for (std::size_t s = 1; s < shares_.size(); ++s) {
        Class const& other = shares_[s].classes[i];
        for (std::size_t b = 0; b < result.counters.size(); ++b) result.counters[b] += other.counters[b];
        result.keys.insert(result.keys.end(), other.keys.begin(), other.keys.end());
    }
    return result;
}

void Quantiles::place_targets() {
    count_ = 0;
    for (Share const& share : shares_) count_ += share.finite;
    for (std::size_t i = 0; i < percents_.size() && count_ > 0; ++i) {
        RankedPosition const at = position_in(count_, percents_[i]);
        targets_[2 * i].rank = at.below;
        targets_[2 * i + 1].rank = at.above;
    }
}

bool Quantiles::end_pass() {
    if (known_ == 0) place_targets();
    if (count_ == 0) return false;
    int const step = std::min(width_ - known_, 16);
    std::vector<Target> const before = targets_;
    for (std::size_t i = 0; i < shares_.front().classes.size(); ++i) {
        Class all = merged(i);
        if (collects_) std::sort(all.keys.begin(), all.keys.end());
        for (std::size_t t = 0; t < targets_.size(); ++t) {
            if (before[t].prefix != all.prefix) continue;
            Target& target = targets_[t];
            if (collects_) {
                // A file that changes between two passes may lack what was counted.
                if (all.keys.empty()) throw Error(ErrorKind::data, "the volume changed while it was read");
                auto const last = static_cast<std::int64_t>(all.keys.size()) - 1;
                target.prefix = all.keys[static_cast<std::size_t>(std::min(target.rank, last))];
                continue;
            }
            std::size_t bin = 0;
            while (bin + 1 < all.counters.size() && target.rank >= all.counters[bin])
                target.rank -= all.counters[bin++];
            target.prefix = target.prefix << step | bin;
            target.voxels = all.counters[bin];
        }
    }
    known_ = collects_ ? width_ : known_ + step;
    shares_.clear();
    if (known_ == width_) return false;
    std::int64_t voxels = 0; // some may be counted twice
    for (Target const& target : targets_) voxels += target.voxels;
    collects_ = voxels <= most_collected;
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
