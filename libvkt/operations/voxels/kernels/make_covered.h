// Balls with exactly covered voxels, which only CPUs make.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/voxels/kernels/make.h"

namespace vkt {

VKT_CPU_KERNEL(make_covered_ball, (AnyView out, BallField const& field, Losses& losses, Execution const& execution),
               (out, field, losses, execution))

} // namespace vkt
