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
    std::optional<bool> big_endian;
};

/// Looks among the words of the file's name for XxYxZ, for a data type and for a byte order: "be" or "le" behind one of
/// the others or as the end of the type ("int16be"), "msb", "lsb", "bigendian", "littleendian", "big" or "little"
/// before "endian". Never fails; finds less instead.
RawName parse_raw_name(std::string_view path);

} // namespace vkt
