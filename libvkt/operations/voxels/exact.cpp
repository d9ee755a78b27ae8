// Exact sums, products and quotients in 128 bits with a sticky rest.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/exact.h"

#include <bit>
#include <cmath>
#include <utility>

namespace vkt {
namespace {

int width_of(std::uint64_t bits) { return static_cast<int>(std::bit_width(bits)); }
int width_of(Unsigned128 bits) {
    auto const high = static_cast<std::uint64_t>(bits >> 64);
    return high != 0 ? 64 + width_of(high) : width_of(static_cast<std::uint64_t>(bits));
}

/// The integer nearest to (magnitude + rest) / 2^drop for drop > 0, halves to even.
Unsigned128 rounded(Unsigned128 magnitude, int drop, bool more) {
    if (drop > 128) return 0;
    Unsigned128 const whole = drop == 128 ? 0 : magnitude >> drop;
    Unsigned128 const rest = drop == 128 ? magnitude : magnitude - (whole << drop);
    Unsigned128 const half = Unsigned128{1} << (drop - 1);
    bool const up = rest > half || (rest == half && (more || (whole & 1) != 0));
    return whole + (up ? 1 : 0);
}

ExactResult as_result(ExactNumber n) { return {n.negative, n.bits, false, n.exponent}; }

} // namespace

ExactNumber ExactNumber::of(std::uint64_t value) { return {false, value, 0}; }

ExactNumber ExactNumber::of(std::int64_t value) {
    auto const bits = static_cast<std::uint64_t>(value);
    return value < 0 ? ExactNumber{true, 0 - bits, 0} : ExactNumber{false, bits, 0};
}

ExactNumber ExactNumber::of(double value) {
    auto const pattern = std::bit_cast<std::uint64_t>(value);
    auto const exponent = static_cast<int>(pattern >> 52 & 0x7ff);
    std::uint64_t const fraction = pattern & 0xfffffffffffff;
    return {(pattern >> 63) != 0, exponent == 0 ? fraction : fraction | std::uint64_t{1} << 52,
            (exponent == 0 ? 1 : exponent) - 1075};
}

ExactResult exact_sum(ExactNumber a, ExactNumber b) {
    if (b.bits == 0) return as_result(a);
    if (a.bits == 0) return as_result(b);
    if (a.exponent + width_of(a.bits) < b.exponent + width_of(b.bits)) std::swap(a, b);
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

ExactResult exact_product(ExactNumber a, ExactNumber b) {
    return {a.negative != b.negative, Unsigned128{a.bits} * b.bits, false, a.exponent + b.exponent};
}

ExactResult exact_quotient(ExactNumber a, ExactNumber b) {
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

int compare(ExactNumber a, ExactNumber b) {
    b.negative = !b.negative;
    ExactResult const difference = exact_sum(a, b);
    if (difference.magnitude == 0) return 0;
    return difference.negative ? -1 : 1;
}

double nearest_float(ExactResult const& value, DataType type) {
    if (value.magnitude == 0) return 0;
    bool const half = type == DataType::float16, single = type == DataType::float32;
    int const digits = half ? 11 : single ? 24 : 53, lowest = half ? -24 : single ? -149 : -1074;
    int const last = std::max(value.exponent + width_of(value.magnitude) - digits, lowest); // bit that is kept
    int const drop = last - value.exponent;
    double const size = drop <= 0 ? std::ldexp(static_cast<double>(value.magnitude), value.exponent)
                                  : std::ldexp(static_cast<double>(rounded(value.magnitude, drop, value.more)), last);
    return value.negative ? -size : size;
}

Int128 nearest_integer(ExactResult const& value) {
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

} // namespace vkt
