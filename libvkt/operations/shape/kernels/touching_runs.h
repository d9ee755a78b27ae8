// Runs of set bits in two rows that touch each other.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/kernel/backend.h"

#include <cstdint>

namespace vkt {

/// Runs of two rows, each counted from its row's first.
struct RunPair {
    std::uint32_t a, b;
};

/// All pairs of a run of `a` and one of `b` that share a position or, if `diagonal`, have neighbouring ones; each pair
/// once. Rows are as pack_bits() makes them, of `words` words. `pairs` has room for as many pairs as positions, and
/// two; `count` is set.
VKT_CPU_KERNEL(touching_runs,
               (std::uint64_t const* a, std::uint64_t const* b, std::int64_t words, bool diagonal, RunPair* pairs,
                std::int64_t& count, Execution const& execution),
               (a, b, words, diagonal, pairs, count, execution))

} // namespace vkt
