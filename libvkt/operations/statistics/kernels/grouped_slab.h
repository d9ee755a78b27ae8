// A slab of voxels that belong to groups: by what lies beside them, or by where they are.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/view.h"

#include <cstdint>
#include <optional>

namespace vkt {

/// What statistics are of: all voxels, or rows by label or by the index along an axis.
enum class GroupedBy : std::uint8_t { volume, label, x, y, z };

struct GroupedSlab {
    ConstView voxels;
    std::optional<ConstView> mask, labels; ///< of the same box
    double zero = 0;                       ///< what the mask stores for 0; NaN, which nothing equals, if it cannot
    GroupedBy by = GroupedBy::volume;
    ValueMap map;
};

} // namespace vkt
