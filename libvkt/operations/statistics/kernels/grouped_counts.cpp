// Only GPUs do it so; see libvkt/operations/statistics/grouped_quantiles.cpp for CPUs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/grouped_counts.h"

#include "libvkt/core/device.h"

namespace vkt::VKT_BACKEND {

void grouped_counts(GroupedSlab const&, DeviceQuantiles&, Execution const&) { throw_without_cuda(); }

} // namespace vkt::VKT_BACKEND
