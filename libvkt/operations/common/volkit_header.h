// Header options in volkit's spelling: bytes per voxel and the range that the stored integers stand for.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/parameters.h"

namespace vkt {

/// The physical values of the smallest and the largest integer of a type.
struct VoxelMapping {
    double low = 0, high = 1;
    friend bool operator==(VoxelMapping const&, VoxelMapping const&) = default;
};

template <> struct ValueText<VoxelMapping> {
    static constexpr int min_words = 2, max_words = 2;
    static std::vector<std::string> choices() { return {}; }
    static VoxelMapping read(std::vector<std::string> const& w, std::string_view name) {
        std::vector<std::string> const parts = w.size() == 1 ? split(w.front(), ',') : w;
        if (parts.size() != 2)
            throw Error(ErrorKind::usage, text(name, ": '", join(w, " "), "' is not two numbers LO HI"));
        return {ValueText<double>::read({parts[0]}, name), ValueText<double>::read({parts[1]}, name)};
    }
    static std::vector<std::string> write(VoxelMapping const& v) { return {to_text(v.low), to_text(v.high)}; }
};

/// The value map under which a type's range means [low, high]. Throws Error{usage} if it is empty or not finite, or if
/// the type is a floating-point type, whose values need no map.
ValueMap value_map_of(VoxelMapping const& mapping, DataType type);

/// uint8, uint16, uint32, uint64 for 1, 2, 4, 8. Throws Error{usage} for other numbers.
DataType type_of_bytes(int bytes_per_voxel);

/// Throws Error{usage} unless all three are positive and finite.
void check_spacing(Vec3 spacing, std::string_view option);
/// Throws Error{usage} unless all extents are positive and the voxels can be counted.
void check_dims(Index3 dims, DataType type, std::string_view option);

} // namespace vkt
