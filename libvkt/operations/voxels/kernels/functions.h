// Elementary functions without branches, for loops over rows: the same result for a value wherever it stands.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <cmath>

namespace vkt::VKT_BACKEND {

/// Beyond these magnitudes sin and cos are the C library's.
inline constexpr double most_angle = 0x1p20;

/// A multiple of pi/2, and what is left of an angle below most_angle: within a unit in its last place.
struct Quadrant {
    double rest;
    std::int64_t count;
};
VKT_HD Quadrant quadrant_of(double angle) {
    constexpr double shift = 6755399441055744.0; // pushes the integer into the low bits of the sum
    constexpr double half_pi[] = {0x1.921fb544p+0, 0x1.0b4611a6p-34, 0x1.3198a2e037073p-69}; // 33 bits, 33, 53
    double const shifted = angle * 0.63661977236758134308 + shift, n = shifted - shift;
    // n has 20 bits: its products with the first two parts are exact.
    return {((angle - n * half_pi[0]) - n * half_pi[1]) - n * half_pi[2], detail::bits_as<std::int64_t>(shifted)};
}
/// Taylor's series up to pi/4, where their remainders are below 2^-60.
VKT_HD double sine_series(double r) {
    double const z = r * r;
    double const p =
        -1.0 / 6 +
        z * (1.0 / 120 +
             z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 +
                                                         z * (1.0 / 6227020800 + z * (-1.0 / 1307674368000 +
                                                                                      z * (1.0 / 355687428096000)))))));
    return r + r * z * p;
}
VKT_HD double cosine_series(double r) {
    double const z = r * r, half = 0.5 * z, w = 1.0 - half;
    double const p =
        1.0 / 24 +
        z * (-1.0 / 720 +
             z * (1.0 / 40320 + z * (-1.0 / 3628800 +
                                     z * (1.0 / 479001600 + z * (-1.0 / 87178291200 + z * (1.0 / 20922789888000))))));
    return w + (((1.0 - w) - half) + z * z * p);
}

/// sin (turns = 0) or cos (turns = 1) of an angle below most_angle, within 2 units in the last place.
VKT_HD double sine_of(double angle, std::int64_t turns) {
    Quadrant const q = quadrant_of(angle);
    std::int64_t const n = q.count + turns;
    double const s = sine_series(q.rest), c = cosine_series(q.rest);
    double const value = (n & 1) != 0 ? c : s;
    return (n & 2) != 0 ? -value : value;
}
/// tan of an angle below most_angle, within 4 units in the last place.
VKT_HD double tangent_of(double angle) {
    Quadrant const q = quadrant_of(angle);
    double const s = sine_series(q.rest), c = cosine_series(q.rest);
    return (q.count & 1) != 0 ? -c / s : s / c;
}

/// e^x within 2 units in the last place.
VKT_HD double exponential_of(double x) {
    constexpr double shift = 6755399441055744.0;
    double const limited = x < -746.0 ? -746.0 : x > 710.0 ? 710.0 : x;
    double const shifted = limited * 1.44269504088896340736 + shift, n = shifted - shift;
    double const r = (limited - n * 0x1.62e42fefp-1) - n * 0x1.473de6af278edp-34; // ln 2 in 33 and 53 bits
    double const p =
        1.0 / 2 +
        r * (1.0 / 6 +
             r * (1.0 / 24 +
                  r * (1.0 / 120 +
                       r * (1.0 / 720 +
                            r * (1.0 / 5040 +
                                 r * (1.0 / 40320 + r * (1.0 / 362880 + r * (1.0 / 3628800 +
                                                                             r * (1.0 / 39916800 +
                                                                                  r * (1.0 / 479001600 +
                                                                                       r * (1.0 / 6227020800)))))))))));
    double const e = 1.0 + (r + r * r * p);
    // 2^n in two factors, since it may be below the smallest normal number or above the largest.
    std::int64_t const whole = detail::bits_as<std::int64_t>(shifted) - detail::bits_as<std::int64_t>(shift);
    std::int64_t const first = whole >> 1, second = whole - first;
    double const scaled =
        e * detail::bits_as<double>((first + 1023) << 52) * detail::bits_as<double>((second + 1023) << 52);
    return x == x ? scaled : x;
}

/// ln x within 2 units in the last place.
VKT_HD double logarithm_of(double x) {
    double const infinite = std::numeric_limits<double>::infinity();
    bool const tiny = x < 0x1p-1022;
    double const normal = tiny ? x * 0x1p54 : x;
    std::int64_t const bits = detail::bits_as<std::int64_t>(normal);
    // The exponent for a mantissa between sqrt(1/2) and sqrt(2).
    std::int64_t const k = (bits - 0x3fe6a09e667f3bcd) >> 52;
    double const m = detail::bits_as<double>(bits - (k << 52));
    double const n = detail::bits_as<double>(k + 0x4338000000000000) - 6755399441055744.0 - (tiny ? 54.0 : 0.0);
    double const f = m - 1.0, s = f / (2.0 + f), z = s * s, half = 0.5 * f * f;
    double const p =
        z * (2.0 / 3 +
             z * (2.0 / 5 +
                  z * (2.0 / 7 +
                       z * (2.0 / 9 +
                            z * (2.0 / 11 +
                                 z * (2.0 / 13 +
                                      z * (2.0 / 15 +
                                           z * (2.0 / 17 + z * (2.0 / 19 + z * (2.0 / 21 + z * (2.0 / 23)))))))))));
    double const value = n * 0x1.62e42fefp-1 + (f - (half - (s * (half + p) + n * 0x1.473de6af278edp-34)));
    double const special = x == 0 ? -infinite : x < 0 ? std::numeric_limits<double>::quiet_NaN() : x; // inf, NaN
    return x > 0 && x < infinite ? value : special;
}

} // namespace vkt::VKT_BACKEND
