// The neighbourhood driver of the back end being compiled, and what functors do to the values of a window.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

#ifdef __CUDACC__
#include "libvkt/kernel/cuda_columns.h"
#else
#include "libvkt/kernel/cpu_stencil.h"
#endif

namespace vkt::VKT_BACKEND {

/// Lane by lane where V is a register; NaN is not ordered: least(NaN, b) is b.
template <class V> VKT_HD V least(V a, V b) { return a < b ? a : b; }
template <class V> VKT_HD V greatest(V a, V b) { return a > b ? a : b; }

} // namespace vkt::VKT_BACKEND
