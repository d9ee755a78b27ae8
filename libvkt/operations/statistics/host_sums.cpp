// From sums of a group in a block to partial statistics.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/host_sums.h"

#include "libvkt/core/type_dispatch.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace vkt {
namespace {

long double long_double_of(Extended const& number) {
    long double const size = std::ldexp(static_cast<long double>(number.mantissa), number.exponent);
    return number.negative != 0 ? -size : size;
}

/// A stored value, and as an integer: 0 of floats.
struct Stored {
    double value = 0;
    Int128 integer = 0;
};
Stored stored_of(std::uint64_t bits, DataType type) {
    if (!is_integer(type)) return {std::bit_cast<double>(bits), 0};
    if (is_signed(type)) {
        auto const integer = static_cast<std::int64_t>(bits);
        return {static_cast<double>(integer), integer};
    }
    return {static_cast<double>(bits), bits};
}

Extreme extreme_of(std::uint64_t bits, std::int64_t at, DataType type, Index3 lower, std::int64_t width) {
    if (at < 0) return {};
    Stored const stored = stored_of(bits, type);
    return {true, stored.value, stored.integer, lower + Index3{at % width, at / width, 0}};
}

} // namespace

void HostProduct::rescale() {
    int by = 0;
    mantissa = std::frexp(mantissa, &by);
    exponent = mantissa == 0 ? 0 : exponent + by;
}

SumsOf<HostNumbers> on_host(SumsOf<DeviceNumbers> const& sums) {
    SumsOf<HostNumbers> result;
    result.finite = sums.finite;
    result.nan = sums.nan;
    result.above = sums.above;
    result.below = sums.below;
    result.low_at = sums.low_at;
    result.high_at = sums.high_at;
    result.low = sums.low;
    result.high = sums.high;
    result.first = sums.first;
    result.integer_sum = sums.integer_sum;
    result.integer_squares = sums.integer_squares;
    result.differences = long_double_of(sums.differences);
    result.squares = long_double_of(sums.squares);
    result.product.mantissa = long_double_of(sums.product.mantissa);
    result.product.exponent = sums.product.exponent;
    return result;
}

PartialStatistics partial_of(SumsOf<HostNumbers> const& sums, DataType type, Index3 lower, std::int64_t width) {
    PartialStatistics p;
    p.moments.finite = sums.finite;
    p.moments.nan = sums.nan;
    p.moments.positive_infinity = sums.above;
    p.moments.negative_infinity = sums.below;
    p.min = extreme_of(sums.low, sums.low_at, type, lower, width);
    p.max = extreme_of(sums.high, sums.high_at, type, lower, width);
    p.product = {sums.product.mantissa, sums.product.exponent};
    p.product.multiply({});
    if (sums.finite == 0) return p;
    Stored const first = stored_of(sums.first, type);
    p.origin = {true, first.value, first.integer};
    p.moments.integer_sum = sums.integer_sum;
    p.moments.squares = sums.integer_squares;
    if (is_integer(type) && size_of(type) <= 4) return p;
    auto const n = static_cast<long double>(sums.finite);
    p.moments.mean = sums.differences / n;
    p.moments.deviations = std::max(0.0L, sums.squares - sums.differences * sums.differences / n);
    if (!is_integer(type)) p.moments.sum = n * first.value + sums.differences;
    return p;
}

} // namespace vkt
