// Moments, products and extremes of parts of a volume: what follows is added.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/statistics.h"

#include <algorithm>
#include <cmath>

namespace vkt {

namespace {

/// Adds with the rounding error kept (Knuth, TAOCP 2, 4.2.2).
void add_keeping_error(long double& sum, long double& error, long double value) {
    long double const next = sum + value;
    long double const back = next - sum;
    error += (sum - (next - back)) + (value - back);
    sum = next;
}

} // namespace

void Moments::append_sum(Moments const& next) {
    nan += next.nan;
    positive_infinity += next.positive_infinity;
    negative_infinity += next.negative_infinity;
    integer_sum += next.integer_sum;
    add_keeping_error(sum, sum_error, next.sum);
    sum_error += next.sum_error;
}

void Moments::append(Moments const& next, bool exact) {
    if (exact) {
        finite += next.finite;
        integer_sum += next.integer_sum;
        squares += next.squares;
        return;
    }
    append_sum(next);
    if (next.finite == 0) return;
    if (finite == 0) {
        finite = next.finite;
        mean = next.mean;
        deviations = next.deviations;
        deviations_error = next.deviations_error;
        return;
    }
    auto const a = static_cast<long double>(finite), b = static_cast<long double>(next.finite);
    long double const delta = next.mean - mean;
    long double const share = b / (a + b);
    add_keeping_error(deviations, deviations_error, next.deviations);
    add_keeping_error(deviations, deviations_error, delta * delta * a * share);
    deviations_error += next.deviations_error;
    mean += delta * share;
    finite += next.finite;
}

Moments moments_of(FloatMoments const& m) {
    Moments wide;
    wide.finite = m.finite;
    wide.nan = m.nan;
    wide.positive_infinity = m.above;
    wide.negative_infinity = m.below;
    wide.sum = m.sum;
    wide.sum_error = m.sum_error;
    wide.mean = static_cast<long double>(m.mean) + m.mean_error;
    wide.deviations = m.deviations;
    wide.deviations_error = m.deviations_error;
    return wide;
}

void SliceStatistics::append(BandStatistics const& band, std::int64_t number, DataType type) {
    bool const integer = is_integer(type);
    if (has_float_moments(type))
        narrow.append(band.narrow);
    else
        moments.append(band.moments, integer && size_of(type) <= 4);
    product.multiply(band.product);
    if (!band.range.valid) return;
    if (!range.valid || (integer ? band.range.integer_low < range.integer_low : band.range.low < range.low)) {
        range.low = band.range.low;
        range.integer_low = band.range.integer_low;
        low_band = number;
    }
    if (!range.valid || (integer ? band.range.integer_high > range.integer_high : band.range.high > range.high)) {
        range.high = band.range.high;
        range.integer_high = band.range.integer_high;
        high_band = number;
    }
    range.valid = true;
}

void Product::multiply(Product const& next) {
    mantissa *= next.mantissa;
    exponent += next.exponent;
    auto const size = std::abs(mantissa);
    if (size >= 1 && size < 4) { // as products of normal ones are
        if (size < 2) return;
        mantissa *= 0.5;
        exponent += 1;
        return;
    }
    int by = 0;
    mantissa = 2 * std::frexp(mantissa, &by);
    exponent = mantissa == 0 ? 0 : exponent + by - 1;
}

double Product::value() const {
    constexpr std::int64_t beyond = 4096;
    return static_cast<double>(std::ldexp(mantissa, static_cast<int>(std::clamp(exponent, -beyond, beyond))));
}

double Product::logarithm() const {
    return static_cast<double>(std::log(std::abs(mantissa)) +
                               static_cast<long double>(exponent) * 0.693147180559945309417232121458176568L);
}

void PartialStatistics::append(PartialStatistics const& next, DataType type) {
    bool const integer = is_integer(type);
    Moments more = next.moments;
    if (!origin.known)
        origin = next.origin;
    else if (next.origin.known)
        more.mean += integer ? static_cast<long double>(next.origin.integer - origin.integer)
                             : static_cast<long double>(next.origin.value) - origin.value;
    moments.append(more, integer && size_of(type) <= 4);
    auto const less = [&](Extreme const& a, Extreme const& b) {
        return integer ? a.integer < b.integer : a.value < b.value;
    };
    if (next.min.valid && (!min.valid || less(next.min, min))) min = next.min;
    if (next.max.valid && (!max.valid || less(max, next.max))) max = next.max;
    product.multiply(next.product);
}

} // namespace vkt
