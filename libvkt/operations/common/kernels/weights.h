// Weights that fall off exponentially, of single values and of registers of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"

#include <cstdint>
#include <utility>

namespace vkt::VKT_BACKEND {

/// Weights below 2^weight_floor count as nothing.
inline constexpr int weight_floor = -125;

/// The signed integers of the same size; of a register a register of them.
template <class V> struct IntegersOf { using type = decltype(std::declval<V>() < std::declval<V>()); };
template <> struct IntegersOf<float> { using type = std::int32_t; };
template <> struct IntegersOf<double> { using type = std::int64_t; };

/// 2^x for weight_floor <= x <= 0, to about 1.5 units in the last place. V is C or a register of C.
template <class C, class V> VKT_HD V exp2_of(V x) {
    using I = typename IntegersOf<V>::type;
    constexpr bool is_float = sizeof(C) == 4;
    // Adding 1.5 * 2^23 (2^52) leaves the nearest integer in the lowest bits of the sum.
    constexpr C shift = is_float ? C(12582912.0) : C(6755399441055744.0);
    V const shifted = x + shift, f = x - (shifted - shift);
    // 2^f = exp(f ln 2) for |f| <= 1/2: as many terms as the type has digits for.
    constexpr double terms[] = {1.0,
                                0.693147180559945309,
                                0.240226506959100712,
                                0.0555041086648215800,
                                0.00961812910762847716,
                                0.00133335581464284434,
                                0.000154035303933816099,
                                0.0000152527338040598403,
                                0.00000132154867901443095,
                                1.01780860092396997e-7,
                                7.05491162080112333e-9,
                                4.44553827187081155e-10,
                                2.56784359934882051e-11,
                                1.36914888539041289e-12};
    constexpr int last = is_float ? 6 : 13;
    V result = V{} + static_cast<C>(terms[last]);
    for (int k = last - 1; k >= 0; --k) result = madd(result, f, V{} + static_cast<C>(terms[k]));
    I const exponent = detail::bits_as<I>(shifted) << (is_float ? 23 : 52);
    return detail::bits_as<V>(detail::bits_as<I>(result) + exponent);
}

} // namespace vkt::VKT_BACKEND
