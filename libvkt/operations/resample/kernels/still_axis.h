// Maps that leave an axis as it is: such slices share the places at which they are sampled.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample/kernels/interpolants.h"

#include <algorithm>
#include <cmath>

namespace vkt::VKT_BACKEND {

/// An axis of the output, y or z, along which nothing happens: its voxels are so many voxels of the input further.
struct StillAxis {
    int axis = -1; ///< -1: there is none
    std::int64_t shift = 0;
};
inline StillAxis still_axis(Affine const& map) {
    for (int axis = 2; axis >= 1; --axis) {
        bool still = map.offset[axis] == nearest_whole(map.offset[axis]) && std::abs(map.offset[axis]) < 0x1p50;
        double reach = 0; // of a voxel in the plane
        for (int a = 0; a < 3; ++a) {
            double const along = map.column[static_cast<std::size_t>(a)][axis];
            still = still && along == (a == axis ? 1 : 0);
            still = still && (a == axis || map.column[static_cast<std::size_t>(axis)][a] == 0);
        }
        for (int b = 0; b < 3; ++b) {
            double sum = 0;
            for (int a = 0; a < 3; ++a) sum += a == axis ? 0 : std::abs(map.column[static_cast<std::size_t>(a)][b]);
            if (b != axis) reach = std::max(reach, sum);
        }
        if (still && reach <= 2) return {axis, static_cast<std::int64_t>(map.offset[axis])};
    }
    return {};
}

} // namespace vkt::VKT_BACKEND
