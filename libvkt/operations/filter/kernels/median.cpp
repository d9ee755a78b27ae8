// Median on CPUs: boxes without a network by a sliding histogram of ranks.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/median.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/median_network.h"

#include <algorithm>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// A multiset of small whole numbers whose middle element is known: counts in two levels, and how many lie below the
/// element. As it changes by an element the middle one moves little.
class SlidingHistogram {
public:
    /// For numbers below `values`; empty, and never to hold more than 2^32 elements.
    void reset(std::int64_t values) {
        fine_.assign(static_cast<std::size_t>((values + block) / block * block), 0);
        coarse_.assign(fine_.size() / block, 0);
        at_ = below_ = 0;
    }
    void add(std::uint32_t v) { change(v, 1); }
    void remove(std::uint32_t v) { change(v, -1); }
    /// The element with `rank` elements before it, of more than `rank`.
    std::uint32_t element(std::int64_t rank) {
        while (below_ > rank) { // the element is less
            if (at_ % block == 0 && below_ - coarse_[at_ / block - 1] > rank) {
                at_ -= block;
                below_ -= coarse_[at_ / block];
            } else {
                --at_;
                below_ -= fine_[at_];
            }
        }
        while (below_ + fine_[at_] <= rank) {
            if (at_ % block == 0 && below_ + coarse_[at_ / block] <= rank) {
                below_ += coarse_[at_ / block];
                at_ += block;
            } else {
                below_ += fine_[at_];
                ++at_;
            }
        }
        return static_cast<std::uint32_t>(at_);
    }

private:
    static constexpr std::size_t block = 64;

    void change(std::uint32_t v, std::int32_t by) {
        fine_[v] += by;
        coarse_[v / block] += by;
        below_ += v < at_ ? by : 0;
    }

    std::vector<std::int32_t> fine_, coarse_;
    std::size_t at_ = 0;
    std::int64_t below_ = 0; ///< elements less than at_
};

/// The medians of a tile: keys become their ranks among those around, and the box walks through the tile, there and
/// back along rows and slices, so that it never starts anew.
template <class K> class MedianTile {
public:
    MedianTile(ConstView in, AnyView out, Index3 radius) : in_(in), out_(out), radius_(radius) {}

    void run(Box const& tile) {
        area_ = {tile.lower - radius_, tile.upper + radius_};
        n_ = area_.dims();
        rank_all();
        histogram_.reset(static_cast<std::int64_t>(values_.size()));
        Index3 const size = tile.dims();
        row_.resize(static_cast<std::size_t>(size.x));
        std::int64_t const rank = (2 * radius_.x + 1) * (2 * radius_.y + 1) * (2 * radius_.z + 1) / 2;
        change({{0, 0, 0}, {2 * radius_.x + 1, 2 * radius_.y + 1, 2 * radius_.z + 1}}, true);
        Index3 at; // lower corner of the box
        bool right = true, down = true;
        for (std::int64_t k = 0; k < size.z; ++k) {
            for (std::int64_t j = 0; j < size.y; ++j) {
                for (std::int64_t i = 0; i < size.x; ++i) {
                    row_[static_cast<std::size_t>(at.x)] = values_[histogram_.element(rank)];
                    if (i + 1 < size.x) step(at, 0, right);
                }
                store_keys(out_.type, row_.data(), out_.at(tile.lower.x, tile.lower.y + at.y, tile.lower.z + k),
                           size.x);
                right = !right;
                if (j + 1 < size.y) step(at, 1, down);
            }
            down = !down;
            if (k + 1 < size.z) step(at, 2, true);
        }
    }

private:
    struct Entry {
        K key;
        std::uint32_t index;
        bool operator<(Entry const& other) const { return key < other.key; }
    };

    /// ranks_ of all voxels around the tile, and values_ by rank.
    void rank_all() {
        auto const count = static_cast<std::size_t>(n_.x * n_.y * n_.z);
        entries_.resize(count);
        ranks_.resize(count);
        row_.resize(static_cast<std::size_t>(n_.x));
        std::size_t next = 0;
        for (std::int64_t z = area_.lower.z; z < area_.upper.z; ++z)
            for (std::int64_t y = area_.lower.y; y < area_.upper.y; ++y) {
                load_keys(in_.type, in_.at(area_.lower.x, y, z), row_.data(), n_.x);
                for (std::int64_t x = 0; x < n_.x; ++x, ++next)
                    entries_[next] = {row_[static_cast<std::size_t>(x)], static_cast<std::uint32_t>(next)};
            }
        values_.clear();
        if constexpr (sizeof(K) == 1) { // the keys are as good as their ranks
            for (int v = 0; v < 256; ++v) values_.push_back(static_cast<K>(v));
            for (Entry const& entry : entries_) ranks_[entry.index] = static_cast<std::uint32_t>(entry.key);
            return;
        }
        std::sort(entries_.begin(), entries_.end());
        for (Entry const& entry : entries_) {
            if (values_.empty() || values_.back() != entry.key) values_.push_back(entry.key);
            ranks_[entry.index] = static_cast<std::uint32_t>(values_.size() - 1);
        }
    }

    void change(Box const& box, bool add) {
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                std::uint32_t const* const row = ranks_.data() + (z * n_.y + y) * n_.x;
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
                    if (add)
                        histogram_.add(row[x]);
                    else
                        histogram_.remove(row[x]);
            }
    }

    /// Moves the box by a voxel along an axis.
    void step(Index3& at, int axis, bool up) {
        Box box{at, at + Index3{2 * radius_.x + 1, 2 * radius_.y + 1, 2 * radius_.z + 1}};
        Box gone = box, come = box;
        if (up) {
            gone.upper[axis] = box.lower[axis] + 1;
            come.lower[axis] = box.upper[axis];
            come.upper[axis] = box.upper[axis] + 1;
        } else {
            gone.lower[axis] = box.upper[axis] - 1;
            come.lower[axis] = box.lower[axis] - 1;
            come.upper[axis] = box.lower[axis];
        }
        change(come, true);
        change(gone, false);
        at[axis] += up ? 1 : -1;
    }

    ConstView in_;
    AnyView out_;
    Index3 radius_, n_;
    Box area_; ///< the tile and its neighbours
    std::vector<Entry> entries_;
    std::vector<std::uint32_t> ranks_;
    std::vector<K> values_, row_;
    SlidingHistogram histogram_;
};

template <class K> void median_of_any(Execution const& execution, AnyView out, Index3 radius, ConstView in) {
    Index3 const tile = median_tile(radius), n = out.dims();
    auto const parts = [](std::int64_t a, std::int64_t b) { return (a + b - 1) / b; };
    Index3 const tiles{parts(n.x, tile.x), parts(n.y, tile.y), parts(n.z, tile.z)};
    std::int64_t const count = tiles.x * tiles.y * tiles.z;
    for_each_item(static_cast<int>(std::min<std::int64_t>(std::max(1, execution.threads), count)), count,
                  [&](std::int64_t first, std::int64_t last) {
                      MedianTile<K> medians(in, out, radius);
                      for (std::int64_t t = first; t < last; ++t) {
                          tell_progress(execution, first, t, last);
                          Index3 const at{t % tiles.x, t / tiles.x % tiles.y, t / tiles.x / tiles.y};
                          Index3 const lower = out.box.lower + Index3{at.x * tile.x, at.y * tile.y, at.z * tile.z};
                          medians.run(intersect({lower, lower + tile}, out.box));
                      }
                  });
}

} // namespace

void median_of_boxes(ConstView in, AnyView out, Index3 radius, Execution const& execution) {
    median_by_network(in, out, radius, execution, [&]<class K>(K) { median_of_any<K>(execution, out, radius, in); });
}

} // namespace VKT_BACKEND

} // namespace vkt
