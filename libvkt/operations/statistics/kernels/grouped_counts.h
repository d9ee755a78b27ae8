// A pass of the selection in groups: voxels are counted by their next bits, or kept. Tables of GPUs, and what all agree
// on.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/statistics/kernels/grouped_slab.h"

namespace vkt {

/// Voxels of a group that begin with the same known bits.
struct QuantileClass {
    std::uint64_t prefix = 0;
    std::int64_t voxels = 0;
    std::int64_t at = 0; ///< first counter, or first voxel that is kept
    bool keeps = false;
};

/// What a pass looks for.
struct QuantileClasses {
    QuantileClass const* classes;
    std::uint32_t const* first; ///< class of every group, and the end
    int width, known, step;     ///< bits of a voxel, those that are known, and those that the pass adds

    static constexpr std::uint32_t none = 0xffffffff;

    /// The number of the class of a voxel of a group, by its ordered bits.
    VKT_HD std::uint32_t of(std::uint32_t group, std::uint64_t bits) const {
        std::uint64_t const prefix = known == 0 ? 0 : bits >> (width - known);
        for (std::uint32_t k = first[group]; k < first[group + 1]; ++k)
            if (classes[k].prefix == prefix) return k;
        return none;
    }
    /// The next bits of such.
    VKT_HD std::int64_t next(std::uint64_t bits) const {
        return static_cast<std::int64_t>(bits >> (width - known - step) & ((std::uint64_t{1} << step) - 1));
    }
};

/// In the memory of a GPU.
struct DeviceQuantiles {
    Buffer classes, first;          ///< QuantileClass, std::uint32_t
    Buffer keys;                    ///< std::int64_t, of the groups, ascending
    Buffer counters, kept, arrived; ///< as hosts have them: eight bytes each
    std::int64_t groups = 0;
    bool contiguous = false; ///< keys follow each other
    int width = 8, known = 0, step = 0;
};

/// Counts, or keeps, the voxels of a slab.
VKT_KERNEL(grouped_counts, (GroupedSlab const& slab, DeviceQuantiles& pass, Execution const& execution),
           (slab, pass, execution))

} // namespace vkt
