// 16-bit IEEE floating point as a storage type: exact widening, correctly rounded narrowing, on every back end alike.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

namespace vkt {

namespace detail {

/// std::bit_cast() that is inlined without optimisation, too: kernels for several instruction sets call it.
template <class To, class From> [[gnu::always_inline]] constexpr To bits_as(From from) {
    static_assert(sizeof(To) == sizeof(From));
    return __builtin_bit_cast(To, from);
}

} // namespace detail

/// binary16: 1 sign, 5 exponent, 10 fraction bits. Compute in float; there is no arithmetic on it. Conversions are
/// branch-free (they vectorise), round half to even, keep subnormals, infinities and the top ten bits of a NaN's
/// payload.
struct Half {
    std::uint16_t bits = 0;

    Half() = default;
    [[gnu::always_inline]] constexpr explicit Half(float value) : bits(narrow(value)) {}
    [[gnu::always_inline]] constexpr explicit Half(double value) : bits(narrow(to_odd(value))) {}
    [[gnu::always_inline]] static constexpr Half from_bits(std::uint16_t bits) {
        Half h;
        h.bits = bits;
        return h;
    }

    [[gnu::always_inline]] constexpr explicit operator float() const {
        // The fraction and exponent moved to float's place are the value times 2^-112, subnormals included.
        std::uint32_t const magnitude = static_cast<std::uint32_t>(bits & 0x7fffu) << 13;
        float const scaled = detail::bits_as<float>(magnitude) * 0x1p112f;
        std::uint32_t const finite = detail::bits_as<std::uint32_t>(scaled);
        std::uint32_t const result = magnitude >= 0x0f800000u ? (magnitude | 0x7f800000u) : finite;
        return detail::bits_as<float>(result | (static_cast<std::uint32_t>(bits & 0x8000u) << 16));
    }
    [[gnu::always_inline]] constexpr explicit operator double() const {
        return static_cast<double>(static_cast<float>(*this));
    }

private:
    [[gnu::always_inline]] static constexpr std::uint16_t narrow(float value) {
        std::uint32_t const all = detail::bits_as<std::uint32_t>(value);
        std::uint32_t const magnitude = all & 0x7fffffffu;
        // Normal: rebias by -112, add just under half an ulp plus the last kept bit, and let carries run.
        std::uint32_t const normal = (magnitude - 0x38000000u + 0xfffu + ((magnitude >> 13) & 1u)) >> 13;
        // Subnormal: an ulp of 0.5 is 2^-24, the unit of a subnormal half, so the addition rounds as it should.
        std::uint32_t const subnormal =
            detail::bits_as<std::uint32_t>(detail::bits_as<float>(magnitude) + 0.5f) - 0x3f000000u;
        std::uint32_t const payload = (magnitude >> 13) & 0x3ffu;
        std::uint32_t const nan = 0x7c00u | (payload == 0 ? 1u : payload);
        std::uint32_t result = magnitude < 0x38800000u ? subnormal : normal;
        result = magnitude >= 0x47800000u ? 0x7c00u : result;
        result = magnitude > 0x7f800000u ? nan : result;
        return static_cast<std::uint16_t>(result | ((all >> 16) & 0x8000u));
    }
    /// Rounds to float so that a second rounding gives what one rounding would have given: inexact results end in 1.
    [[gnu::always_inline]] static constexpr float to_odd(double value) {
        float const nearest = static_cast<float>(value);
        double const back = static_cast<double>(nearest);
        std::uint32_t bits = detail::bits_as<std::uint32_t>(nearest);
        bool const larger = (value < 0 ? -back : back) > (value < 0 ? -value : value);
        bits = larger ? bits - 1u : bits;
        bits = back < value || back > value ? (bits | 1u) : bits;
        return detail::bits_as<float>(bits);
    }
};

static_assert(sizeof(Half) == 2);

} // namespace vkt
