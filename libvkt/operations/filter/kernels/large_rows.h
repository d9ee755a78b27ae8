// Rows of values on CPUs: whether some are so large that sums of them may overflow.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/large_values.h"

namespace vkt::VKT_BACKEND {

template <class C> bool any_large(C const* values, std::int64_t n, C headroom) {
    std::int32_t found = 0;
#pragma omp simd reduction(| : found)
    for (std::int64_t x = 0; x < n; ++x) found |= is_large(values[x], headroom) ? 1 : 0;
    return found != 0;
}

} // namespace vkt::VKT_BACKEND
