// Flooding a volume from markers in the order of its values, and finding the minima to flood from.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/view.h"

#include <cstdint>
#include <vector>

namespace vkt {

/// A volume as ranks of its values, with a rim of voxels that are never flooded, so that no neighbour is off it. One
/// thread; voxels are numbered x fastest, rim included, in 32 bits.
class Flooding {
public:
    static constexpr std::uint32_t outside = 0xffffffff; ///< label of the rim and of what the mask leaves out

    struct Result {
        std::int64_t flooded = 0, line = 0, left = 0; ///< voxels with a label, between labels, never reached
    };

    /// Most bytes that flooding a volume takes beside its input and output; of minima, if these are wanted too.
    static double bytes(Index3 dims, DataType type, bool minima);
    /// True if voxels can be numbered.
    static bool can(Index3 dims);

    /// -0 is 0; NaN is above all numbers. `descending` turns the order of numbers around. Where `mask` is not null,
    /// only voxels whose byte is not 0 take part. The monitor, if there is one, is told of everything; after it
    /// cancelled only destroying makes sense.
    Flooding(ConstView values, bool descending, std::uint8_t const* mask, int connectivity, bool keep_order,
             ProgressMonitor* monitor = nullptr);

    /// Labels a voxel: a marker. False if the voxel does not take part.
    bool mark(Index3 voxel, std::uint32_t label);
    /// Makes every regional minimum a marker that is at least so deep: so much lower than where it flows over to a
    /// lower one, or an equal one that comes before it. Numbers them by their first voxel; returns how many there are.
    /// Needs the order to have been kept, and drops it.
    std::int64_t mark_minima(double depth);
    /// Floods from the markers: always the voxel of the lowest value that has a labelled neighbour, of equal ones that
    /// which got one first; neighbours in the order of their distance, then of x, y, z. With `line`, voxels between
    /// different labels stay 0, and are not flooded from.
    Result flood(bool line);
    std::uint32_t highest_label() const { return highest_; }
    /// The label of a voxel; 0 if it has none.
    std::uint32_t label(Index3 voxel) const {
        std::uint32_t const l = labels_[at(voxel)];
        return l == outside ? 0 : l;
    }

private:
    std::size_t at(Index3 v) const {
        return static_cast<std::size_t>(((v.z + 1) * (dims_.y + 2) + v.y + 1) * (dims_.x + 2) + v.x + 1);
    }
    template <class T, class Key> void rank(ConstView values, bool descending, bool keep_order);

    void tell(std::size_t done, std::size_t of) const {
        if (monitor_ != nullptr && done % 65536 == 0)
            monitor_->poll(static_cast<std::int64_t>(done), static_cast<std::int64_t>(of));
    }

    Index3 dims_;
    ProgressMonitor* monitor_ = nullptr;
    std::vector<std::int64_t> steps_;   ///< to the neighbours
    std::vector<std::uint32_t> ranks_;  ///< of voxels
    std::vector<std::uint32_t> labels_; ///< 0: none yet
    std::vector<std::uint32_t> order_;  ///< voxels by value, then by number
    std::vector<double> values_;        ///< of ranks, in ascending order; NaN as infinity
    std::uint32_t highest_ = 0;
    std::vector<std::uint32_t> markers_; ///< in ascending order once flooding begins
};

} // namespace vkt
