// Numbers for people: a few digits.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/text.h"

#include <array>
#include <cstdio>
#include <string>

namespace vkt::shell {

inline std::string short_number(double value) {
    std::array<char, 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%.3g", value);
    return buffer.data();
}

} // namespace vkt::shell
