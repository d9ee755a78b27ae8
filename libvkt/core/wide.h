// 128-bit integers for sums and products that must not round, and their decimal texts.
// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

namespace vkt {

__extension__ typedef __int128 Int128;
__extension__ typedef unsigned __int128 Unsigned128;

inline std::string to_text(Int128 value) {
    std::string digits;
    Unsigned128 left = value < 0 ? Unsigned128{0} - static_cast<Unsigned128>(value) : static_cast<Unsigned128>(value);
    do {
        digits.push_back(static_cast<char>('0' + static_cast<int>(left % 10)));
        left /= 10;
    } while (left != 0);
    if (value < 0) digits.push_back('-');
    std::reverse(digits.begin(), digits.end());
    return digits;
}

/// Nearest double of a / b for b > 0, without forming a in double first.
inline double quotient(Int128 a, std::int64_t b) {
    Int128 const whole = a / b;
    return static_cast<double>(whole) + static_cast<double>(a - whole * b) / static_cast<double>(b);
}

} // namespace vkt
