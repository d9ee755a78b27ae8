// What the name of a raw file says: "engine_256x256x128_uint8.raw".
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <optional>
#include <string_view>

namespace vkt {

struct RawName {
    std::optional<Index3> dims;
    std::optional<DataType> dtype;
};

/// Looks for XxYxZ and for a data type among the words of the file's name. Never fails; finds less instead.
RawName parse_raw_name(std::string_view path);

} // namespace vkt
