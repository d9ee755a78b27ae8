// One operation on two numbers without rounding, and the result rounded once: sums, products and quotients in 128 bits
// with a sticky rest. For kernel sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/exact.h"

namespace vkt::VKT_BACKEND {

/// (negative ? -1 : 1) * (magnitude + rest) * 2^exponent, 0 < rest < 1 if there is more and 0 otherwise. With more the
/// magnitude has 95 bits at least, so that no rounding to 64 bits depends on the rest beyond its being there.
struct ExactResult {
    bool negative = false;
    Unsigned128 magnitude = 0;
    bool more = false;
    int exponent = 0;
};

/// Bits up to the highest that is set.
VKT_HD int width_of(std::uint64_t bits) {
    int width = 0;
    for (int step = 32; step > 0; step /= 2)
        if (bits >> step != 0) {
            bits >>= step;
            width += step;
        }
    return width + static_cast<int>(bits);
}
VKT_HD int width_of(Unsigned128 bits) {
    auto const high = static_cast<std::uint64_t>(bits >> 64);
    return high != 0 ? 64 + width_of(high) : width_of(static_cast<std::uint64_t>(bits));
}

/// The integer nearest to (magnitude + rest) / 2^drop for drop > 0, halves to even.
VKT_HD Unsigned128 rounded(Unsigned128 magnitude, int drop, bool more) {
    if (drop > 128) return 0;
    Unsigned128 const whole = drop == 128 ? 0 : magnitude >> drop;
    Unsigned128 const rest = drop == 128 ? magnitude : magnitude - (whole << drop);
    Unsigned128 const half = Unsigned128{1} << (drop - 1);
    bool const up = rest > half || (rest == half && (more || (whole & 1) != 0));
    return whole + (up ? 1 : 0);
}

VKT_HD ExactResult as_result(ExactNumber n) { return {n.negative, n.bits, false, n.exponent}; }

VKT_CALLED ExactResult exact_sum(ExactNumber a, ExactNumber b) {
    if (b.bits == 0) return as_result(a);
    if (a.bits == 0) return as_result(b);
    if (a.exponent + width_of(a.bits) < b.exponent + width_of(b.bits)) {
        ExactNumber const other = a;
        a = b;
        b = other;
    }
    // The larger one begins at bit 124; of the smaller one only what lies below bit 0 is left over.
    int const up = 125 - width_of(a.bits), exponent = a.exponent - up, shift = b.exponent - exponent;
    auto const large = static_cast<Int128>(Unsigned128{a.bits} << up);
    Int128 small = 0;
    if (shift >= 0)
        small = static_cast<Int128>(Unsigned128{b.bits} << shift);
    else if (shift > -64)
        small = static_cast<Int128>(b.bits >> -shift);
    bool const more = shift < 0 && (shift <= -64 || (b.bits & ((std::uint64_t{1} << -shift) - 1)) != 0);
    if (b.negative) small = -small - (more ? 1 : 0); // rounded down, so that the rest is positive
    Int128 const sum = (a.negative ? -large : large) + small;
    ExactResult result{sum < 0, 0, more, exponent};
    result.magnitude = static_cast<Unsigned128>(sum < 0 ? -sum - (more ? 1 : 0) : sum);
    return result;
}

VKT_CALLED ExactResult exact_product(ExactNumber a, ExactNumber b) {
    return {a.negative != b.negative, Unsigned128{a.bits} * b.bits, false, a.exponent + b.exponent};
}

/// b must not be 0.
VKT_CALLED ExactResult exact_quotient(ExactNumber a, ExactNumber b) {
    ExactResult result;
    if (a.bits == 0) return result;
    int const up_a = 128 - width_of(a.bits), up_b = 64 - width_of(b.bits);
    Unsigned128 const numerator = Unsigned128{a.bits} << up_a, denominator = Unsigned128{b.bits} << up_b;
    // The first digit has 64 or 65 bits, the second adds 32 to them.
    Unsigned128 const first = numerator / denominator, left = (numerator - first * denominator) << 32;
    Unsigned128 const second = left / denominator;
    result.negative = a.negative != b.negative;
    result.magnitude = (first << 32) + second;
    result.more = left != second * denominator;
    result.exponent = (a.exponent - up_a) - (b.exponent - up_b) - 32;
    return result;
}

/// Negative, 0 or positive as a is less than, equal to or greater than b.
VKT_CALLED int compare(ExactNumber a, ExactNumber b) {
    b.negative = !b.negative;
    ExactResult const difference = exact_sum(a, b);
    if (difference.magnitude == 0) return 0;
    return difference.negative ? -1 : 1;
}

/// m * 2^exponent for exponents from -1074 to 2046, exact if a double can be.
VKT_HD double scaled(std::uint64_t m, int exponent) {
    auto const power = [](int e) { return detail::bits_as<double>(static_cast<std::int64_t>(e + 1023) << 52); };
    return static_cast<double>(m) * power(exponent / 2) * power(exponent - exponent / 2);
}

/// The nearest value of a floating type, halves to even; beyond the type's range a value that is not in it, or
/// infinity.
VKT_CALLED double nearest_float(ExactResult const& value, DataType type) {
    if (value.magnitude == 0) return 0;
    bool const half = type == DataType::float16, single = type == DataType::float32;
    int const digits = half ? 11 : single ? 24 : 53, lowest = half ? -24 : single ? -149 : -1074;
    int const fits = value.exponent + width_of(value.magnitude) - digits, last = fits > lowest ? fits : lowest;
    int const drop = last - value.exponent; // `last` is the last bit that is kept
    double const size = drop <= 0
                            ? scaled(static_cast<std::uint64_t>(value.magnitude), value.exponent)
                            : scaled(static_cast<std::uint64_t>(rounded(value.magnitude, drop, value.more)), last);
    return value.negative ? -size : size;
}

/// The nearest integer, halves to even; saturates beyond 2^100.
VKT_CALLED Int128 nearest_integer(ExactResult const& value) {
    Unsigned128 size = value.magnitude;
    if (size == 0) return 0;
    if (value.exponent + width_of(size) > 100)
        size = Unsigned128{1} << 100;
    else if (value.exponent >= 0)
        size <<= value.exponent;
    else
        size = rounded(size, -value.exponent, value.more);
    return value.negative ? -static_cast<Int128>(size) : static_cast<Int128>(size);
}

} // namespace vkt::VKT_BACKEND
