// Sums that overflow where their results do not: which numbers are so large, on CPUs and GPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt::VKT_BACKEND {

/// Whether a number is one, and so large that something in between may overflow. `headroom`: the power of two by which
/// all numbers may be multiplied, so that nothing does.
template <class C> VKT_HD bool is_large(C value, C headroom) {
    constexpr C most = sizeof(C) == 4 ? C(0x1.fffffep127) : C(0x1.fffffffffffffp1023);
    C const size = value < 0 ? -value : value;
    return size > most * headroom && size <= most;
}

template <class C> VKT_HD bool is_finite(C value) {
    return value - value == 0; // NOLINT(misc-redundant-expression): NaN, and what is not finite
}

#ifndef __CUDACC__

template <class C> bool any_large(C const* values, std::int64_t n, C headroom) {
    std::int32_t found = 0;
#pragma omp simd reduction(| : found)
    for (std::int64_t x = 0; x < n; ++x) found |= is_large(values[x], headroom) ? 1 : 0;
    return found != 0;
}

template <class C> bool all_finite(C const* values, std::int64_t n) {
    C odd = 0;
#pragma omp simd reduction(+ : odd)
    for (std::int64_t x = 0; x < n; ++x) odd += values[x] - values[x]; // NOLINT(misc-redundant-expression): as above
    return odd == 0;
}

#endif

} // namespace vkt::VKT_BACKEND
