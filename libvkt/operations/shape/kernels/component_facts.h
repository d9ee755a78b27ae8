// What is known of a connected component.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <cstdint>

namespace vkt {

struct ComponentFacts {
    std::uint64_t size = 0;                             ///< voxels
    std::uint64_t sum_x = 0, sum_y = 0, sum_z = 0;      ///< of their indices
    std::int32_t lower_x = 0, lower_y = 0, lower_z = 0; ///< bounding box, half-open
    std::int32_t upper_x = 0, upper_y = 0, upper_z = 0;
    VoxelBytes value_before{}; ///< the stored voxel before the first one, in its row or in one of a single voxel
};

} // namespace vkt
