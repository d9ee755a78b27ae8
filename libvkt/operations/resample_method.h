// Ways to resample, by their names.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"

namespace vkt {

enum class ResampleMethod : std::uint8_t { automatic, nearest, linear, area, cubic, basis, average };
template <> struct EnumNames<ResampleMethod> {
    static std::vector<std::pair<ResampleMethod, char const*>> all() {
        return {{ResampleMethod::automatic, "auto"}, {ResampleMethod::nearest, "nearest"},
                {ResampleMethod::linear, "linear"},  {ResampleMethod::area, "area"},
                {ResampleMethod::cubic, "cubic"},    {ResampleMethod::basis, "basis"},
                {ResampleMethod::average, "average"}};
    }
};

} // namespace vkt
