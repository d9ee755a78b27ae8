// Balls with exactly covered voxels. Sines of GPUs have other last bits than those of CPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/voxels/kernels/make.h"

namespace vkt {

VKT_KERNEL(make_covered_ball, (AnyView out, BallField const& field, Losses& losses, Execution const& execution),
           (out, field, losses, execution))

} // namespace vkt
