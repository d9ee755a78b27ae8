// Rows of values on CPUs: whether all of them are finite.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

namespace vkt::VKT_BACKEND {

template <class C> bool all_finite(C const* values, std::int64_t n) {
    C odd = 0;
#pragma omp simd reduction(+ : odd)
    for (std::int64_t i = 0; i < n; ++i) odd += values[i] - values[i]; // NOLINT(misc-redundant-expression): NaN, too
    return odd == 0;
}

} // namespace vkt::VKT_BACKEND
