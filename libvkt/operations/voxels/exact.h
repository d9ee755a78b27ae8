// One operation on two numbers without rounding, and the result rounded once: float arithmetic, which rounds to its
// own type first, cannot promise that.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/core/wide.h"

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

/// (negative ? -1 : 1) * (magnitude + rest) * 2^exponent, 0 < rest < 1 if there is more and 0 otherwise. With more the
/// magnitude has 95 bits at least, so that no rounding to 64 bits depends on the rest beyond its being there.
struct ExactResult {
    bool negative = false;
    Unsigned128 magnitude = 0;
    bool more = false;
    int exponent = 0;
};

ExactResult exact_sum(ExactNumber a, ExactNumber b);
ExactResult exact_product(ExactNumber a, ExactNumber b);
/// b must not be 0.
ExactResult exact_quotient(ExactNumber a, ExactNumber b);
/// Negative, 0 or positive as a is less than, equal to or greater than b.
int compare(ExactNumber a, ExactNumber b);

/// The nearest value of a floating type, halves to even; beyond the type's range a value that is not in it, or
/// infinity.
double nearest_float(ExactResult const& value, DataType type);
/// The nearest integer, halves to even; saturates beyond 2^100.
Int128 nearest_integer(ExactResult const& value);

} // namespace vkt
