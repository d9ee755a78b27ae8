// Checks and meanings of header options.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/volkit_header.h"

#include <cmath>

namespace vkt {

ValueMap value_map_of(VoxelMapping const& mapping, DataType type) {
    if (!std::isfinite(mapping.low) || !std::isfinite(mapping.high) || !(mapping.low < mapping.high))
        throw Error(ErrorKind::usage,
                    text("--voxel-mapping: ", mapping.low, " ", mapping.high, " is not an ascending pair of numbers"));
    if (!is_integer(type))
        throw Error(ErrorKind::usage,
                    text("--voxel-mapping does not apply to ", type, ", whose voxels hold their values as they are"));
    double const slope = (mapping.high - mapping.low) / (highest_of(type) - lowest_of(type));
    return {slope, mapping.low - slope * lowest_of(type)};
}

DataType type_of_bytes(int bytes_per_voxel) {
    switch (bytes_per_voxel) {
    case 1:
        return DataType::uint8;
    case 2:
        return DataType::uint16;
    case 4:
        return DataType::uint32;
    case 8:
        return DataType::uint64;
    default:
        break;
    }
    throw Error(ErrorKind::usage, text("--bytes-per-voxel: ", bytes_per_voxel, " is not one of 1, 2, 4, 8"));
}

void check_spacing(Vec3 spacing, std::string_view option) {
    for (int axis = 0; axis < 3; ++axis)
        if (!std::isfinite(spacing[axis]) || !(spacing[axis] > 0))
            throw Error(ErrorKind::usage, text("--", option, ": ", spacing[axis], " is not a positive length"));
}

void check_dims(Index3 dims, DataType type, std::string_view option) {
    Header header;
    header.dims = dims;
    header.dtype = type;
    for (int axis = 0; axis < 3; ++axis)
        if (dims[axis] < 1)
            throw Error(ErrorKind::usage, text("--", option, ": ", dims[axis], " is not a positive number of voxels"));
    try {
        check(header);
    } catch (Error const& e) {
        throw Error(ErrorKind::usage, text("--", option, " ", dims, ": ", e.what()));
    }
}

} // namespace vkt
