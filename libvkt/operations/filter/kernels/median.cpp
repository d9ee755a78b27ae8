// Median on CPUs: boxes without a network by a sliding histogram of ranks.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/median.h"

#include "libvkt/kernel/cpu_tiles.h"
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
    /// So many more of an element, or fewer.
    void add(std::uint32_t v, std::int32_t by) {
        fine_[v] += by;
        coarse_[v / block] += by;
        below_ += v < at_ ? by : 0;
    }
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

    std::vector<std::int32_t> fine_, coarse_;
    std::size_t at_ = 0;
    std::int64_t below_ = 0; ///< elements less than at_
};

/// The medians of a tile: keys become their ranks among those around, and the box walks through the tile, there and
/// back along rows and slices, so that it never starts anew.
template <class K> class MedianTile {
public:
    MedianTile(ConstView in, AnyView out, Index3 radius)
        : in_(in), out_(out), radius_(radius), edges_(grow({{}, {1, 1, 1}}, radius).dims()) {}

    void run(Box const& tile) {
        area_ = grow(tile, radius_);
        n_ = area_.dims();
        rank_all();
        histogram_.reset(static_cast<std::int64_t>(values_.size()));
        Index3 const size = tile.dims();
        row_.resize(static_cast<std::size_t>(size.x));
        std::int64_t const rank = box_of(edges_).voxels() / 2;
        add(box_of(edges_), 1);
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

    void add(Box const& box, std::int32_t by) {
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                std::uint32_t const* const row = ranks_.data() + (z * n_.y + y) * n_.x;
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) histogram_.add(row[x], by);
            }
    }

    /// Moves the box by a voxel along an axis.
    void step(Index3& at, int axis, bool up) {
        Box come{at, at + edges_}, gone = come;
        come.lower[axis] = up ? come.upper[axis] : at[axis] - 1;
        come.upper[axis] = come.lower[axis] + 1;
        gone.lower[axis] = up ? at[axis] : gone.upper[axis] - 1;
        gone.upper[axis] = gone.lower[axis] + 1;
        add(come, 1);
        add(gone, -1);
        at[axis] += up ? 1 : -1;
    }

    ConstView in_;
    AnyView out_;
    Index3 radius_, edges_; ///< of the box
    Box area_;              ///< the tile and its neighbours
    Index3 n_;              ///< its extent
    std::vector<Entry> entries_;
    std::vector<std::uint32_t> ranks_;
    std::vector<K> values_, row_;
    SlidingHistogram histogram_;
};

} // namespace

void median_of_boxes(ConstView in, AnyView out, Index3 radius, Execution const& execution) {
    median_by_network(in, out, radius, execution, [&]<class K>(K) {
        for_each_tile(execution, execution.threads, out.box, median_tile(radius), [&](auto const& each) {
            MedianTile<K> medians(in, out, radius);
            each([&](Box const& tile) { medians.run(tile); });
        });
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
