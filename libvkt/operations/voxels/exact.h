// Finite numbers as integers times powers of two, for arithmetic that rounds its result once: float arithmetic, which
// rounds to its own type first, cannot promise that.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

namespace vkt {

/// A finite number: (negative ? -1 : 1) * bits * 2^exponent. Holds every voxel of every type.
struct ExactNumber {
    bool negative = false;
    std::uint64_t bits = 0;
    int exponent = 0;

    static ExactNumber of(std::int64_t value);
    static ExactNumber of(std::uint64_t value);
    static ExactNumber of(double value); ///< must be finite
};

} // namespace vkt
