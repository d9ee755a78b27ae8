// What a host does in long double, of integers: the same bits on GPUs, which have no such type.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/half.h"
#include "libvkt/core/wide.h"
#include "libvkt/kernel/host_device.h"

#include <cstdint>

namespace vkt {

/// A number with a mantissa of 64 bits, the highest of which is 1, or 0: mantissa * 2^exponent. Sums and products are
/// rounded to the nearest, halves to even, as x87 does it; exponents have no bounds that doubles and their squares
/// meet.
struct Extended {
    std::uint64_t mantissa = 0;
    std::int32_t exponent = 0;
    std::int32_t negative = 0; ///< or not: 0

    Extended() = default;
    VKT_HD Extended(std::uint64_t bits, std::int32_t scale, bool below_zero)
        : mantissa(bits), exponent(scale), negative(below_zero ? 1 : 0) {}
    /// Finite.
    VKT_HD explicit Extended(double value) {
        auto const bits = detail::bits_as<std::uint64_t>(value);
        std::uint64_t const fraction = bits & ((std::uint64_t{1} << 52) - 1);
        auto const scale = static_cast<std::int32_t>(bits >> 52 & 0x7ff);
        negative = static_cast<std::int32_t>(bits >> 63);
        if (scale != 0) {
            mantissa = (fraction | std::uint64_t{1} << 52) << 11;
            exponent = scale - 1075 - 11;
        } else {
            mantissa = fraction;
            exponent = -1074;
            std::uint64_t none = 0;
            normalise(mantissa, none, exponent);
        }
    }
    VKT_HD static Extended of_integer(std::uint64_t size, bool negative) {
        Extended result(size, 0, negative && size != 0);
        std::uint64_t none = 0;
        normalise(result.mantissa, none, result.exponent);
        return result;
    }

    VKT_HD friend Extended operator*(Extended a, Extended b) {
        bool const negative = a.negative != b.negative;
        if (a.mantissa == 0 || b.mantissa == 0) return {0, 0, negative};
        Unsigned128 const product = static_cast<Unsigned128>(a.mantissa) * b.mantissa;
        auto high = static_cast<std::uint64_t>(product >> 64), low = static_cast<std::uint64_t>(product);
        std::int32_t exponent = a.exponent + b.exponent + 64;
        if (high >> 63 == 0) {
            high = high << 1 | low >> 63;
            low <<= 1;
            --exponent;
        }
        return rounded(high, low, exponent, negative);
    }

    VKT_HD friend Extended operator+(Extended a, Extended b) {
        if (a.mantissa == 0 && b.mantissa == 0) return {0, 0, a.negative != 0 && b.negative != 0};
        if (a.mantissa == 0) return b;
        if (b.mantissa == 0) return a;
        if (a.exponent < b.exponent || (a.exponent == b.exponent && a.mantissa < b.mantissa)) {
            Extended const less = a;
            a = b;
            b = less;
        }
        // What b has below a's last bit: 64 bits, the last of which stands for all that follow as well.
        std::uint64_t high = b.mantissa, low = 0;
        std::int32_t const by = a.exponent - b.exponent;
        if (by >= 128) {
            high = 0;
            low = 1;
        } else if (by >= 64) {
            high = 0;
            low = b.mantissa >> (by - 64);
            if (by > 64 && b.mantissa << (128 - by) != 0) low |= 1;
        } else if (by > 0) {
            high = b.mantissa >> by;
            low = b.mantissa << (64 - by);
        }
        std::int32_t exponent = a.exponent;
        if (a.negative == b.negative) {
            high += a.mantissa;
            if (high < a.mantissa) { // a bit too many
                low = low >> 1 | (low & 1) | high << 63;
                high = high >> 1 | std::uint64_t{1} << 63;
                ++exponent;
            }
        } else {
            high = a.mantissa - high - (low != 0 ? 1 : 0);
            low = 0 - low;
            if (high == 0 && low == 0) return {};
            normalise(high, low, exponent);
        }
        return rounded(high, low, exponent, a.negative != 0);
    }
    VKT_HD friend Extended operator-(Extended a, Extended b) {
        b.negative = b.negative != 0 ? 0 : 1;
        return a + b;
    }

private:
    /// Of 128 bits the highest is to be 1, if there is one.
    VKT_HD static void normalise(std::uint64_t& high, std::uint64_t& low, std::int32_t& exponent) {
        if (high == 0) {
            high = low;
            low = 0;
            exponent -= 64;
        }
        if (high == 0) {
            exponent = 0;
            return;
        }
        for (int by = 32; by > 0; by /= 2) {
            if (high >> (64 - by) != 0) continue;
            high = high << by | low >> (64 - by);
            low <<= by;
            exponent -= by;
        }
    }
    VKT_HD static Extended rounded(std::uint64_t high, std::uint64_t low, std::int32_t exponent, bool negative) {
        constexpr std::uint64_t half = std::uint64_t{1} << 63;
        if (low > half || (low == half && (high & 1) != 0)) ++high;
        if (high == 0) {
            high = half;
            ++exponent;
        }
        return {high, exponent, negative};
    }
};

} // namespace vkt
