// Integers and doubles as exact numbers.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/exact.h"

#include <bit>

namespace vkt {

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

} // namespace vkt
