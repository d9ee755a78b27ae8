// Headers with their axes in another order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/axis_order.h"

namespace vkt {

std::array<int, 3> axes_without(int axis) { return {axis == 0 ? 1 : 0, axis == 2 ? 1 : 2, axis}; }

Header with_axes(Header const& in, std::array<int, 3> const& axes) {
    Header result = in;
    for (std::size_t k = 0; k < 3; ++k) {
        auto const own = static_cast<int>(k);
        result.dims[own] = in.dims[axes[k]];
        result.geometry.spacing[own] = in.geometry.spacing[axes[k]];
        result.geometry.direction[k] = in.geometry.direction[static_cast<std::size_t>(axes[k])];
        if (!in.part) continue;
        result.part->global_dims[own] = in.part->global_dims[axes[k]];
        result.part->offset[own] = in.part->offset[axes[k]];
        result.part->halo[own] = in.part->halo[axes[k]];
    }
    return result;
}

} // namespace vkt
