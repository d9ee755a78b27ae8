// The bin of a value where bins have equal widths, the same on CPUs and GPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/bins.h"

#include <type_traits>

namespace vkt::VKT_BACKEND {

/// -1 for what is not finite.
template <class T> VKT_HD std::int64_t bin_of(T value, BinRule const& rule) {
    std::int64_t const last = rule.count - 1;
    double position = 0;
    if constexpr (std::is_integral_v<T>) {
        Int128 const whole = static_cast<Int128>(value) - rule.base;
        if (rule.width == 0) return whole < 0 ? 0 : whole > last ? last : static_cast<std::int64_t>(whole);
        position = static_cast<double>(whole);
    } else {
        position = static_cast<double>(value);
        if (!(position - position == 0)) return -1;
    }
    if (rule.width == 0) return 0;
    double const guess = (position - rule.low) * rule.per_unit, highest = static_cast<double>(last);
    auto bin = static_cast<std::int64_t>(guess > 0 ? guess < highest ? guess : highest : 0);
    // Edges are where the sum says, not the quotient.
    auto const edge = [&](std::int64_t i) { return rule.low + static_cast<double>(i) * rule.width; };
    if (bin > 0 && position < edge(bin)) --bin;
    if (bin < last && position >= edge(bin + 1)) ++bin;
    return bin;
}

} // namespace vkt::VKT_BACKEND
