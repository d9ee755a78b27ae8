// Only GPUs do it so; see libvkt/operations/statistics/grouped_statistics.cpp for CPUs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/grouped_sums.h"

#include "libvkt/core/device.h"

namespace vkt::VKT_BACKEND {

void grouped_sums(GroupedSlab const&, std::int64_t, std::int64_t,
                  std::function<void(std::vector<GroupInBlock> const&)> const&, Execution const&) {
    throw_without_cuda();
}

} // namespace vkt::VKT_BACKEND
