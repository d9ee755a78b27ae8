// Sums of groups of voxels on GPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/statistics/kernels/grouped_slab.h"
#include "libvkt/operations/statistics/kernels/running_sums.h"

#include <functional>
#include <vector>

namespace vkt {

/// Sums the groups of each block of so many rows and calls visit(groups of some blocks) until all are told, block by
/// block; of one that has more than `most`, all at once. Groups sum their voxels in x-fastest order, as CPUs do.
VKT_KERNEL(grouped_sums,
           (GroupedSlab const& slab, std::int64_t rows, std::int64_t most,
            std::function<void(std::vector<GroupInBlock> const&)> const& visit, Execution const& execution),
           (slab, rows, most, visit, execution))

} // namespace vkt
