// Sizes of a lattice in the world.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/render/camera.h"

#include <algorithm>
#include <cmath>

namespace vkt::render {

inline double smallest_spacing(Geometry const& g) { return std::min({g.spacing.x, g.spacing.y, g.spacing.z}); }

/// Volume of one voxel in the world.
inline double voxel_size(Geometry const& g) {
    Matrix3 const m = lattice_to_world(g);
    Double3 const c{m.y.y * m.z.z - m.y.z * m.z.y, m.y.z * m.z.x - m.y.x * m.z.z, m.y.x * m.z.y - m.y.y * m.z.x};
    return std::abs(dot(m.x, c));
}

inline double diagonal(Geometry const& g, Index3 dims) {
    auto const c = corners_of(g, box_of(dims));
    double longest = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        Vec3 const d = c[7 - i] - c[i];
        longest = std::max(longest, std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
    }
    return longest;
}

} // namespace vkt::render
