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

} // namespace vkt::VKT_BACKEND
