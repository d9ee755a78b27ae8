// Where voxels lie in the world: origin, spacing, direction, and how crops, flips and scalings move them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <array>

namespace vkt {

/// World position of the centre of voxel (i,j,k) = origin + direction * (spacing * (i,j,k)).
/// direction holds one unit column per index axis, direction[axis] being the world direction in which the index grows.
struct Geometry {
    Vec3 origin{0, 0, 0};
    Vec3 spacing{1, 1, 1}; ///< positive, world units per voxel
    std::array<Vec3, 3> direction{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

    friend bool operator==(Geometry const&, Geometry const&) = default;
};

Vec3 index_to_world(Geometry const& geometry, Vec3 index);
/// Throws Error{data} if the directions are linearly dependent.
Vec3 world_to_index(Geometry const& geometry, Vec3 world);

/// Geometry of the sub-volume that starts at voxel `lower`.
Geometry cropped(Geometry const& geometry, Index3 lower);
/// Geometry after reversing the voxel order along an axis: voxels keep their world positions.
Geometry flipped(Geometry const& geometry, Axis axis, std::int64_t n);
/// Geometry of the same extent sampled with other dims: cell-centred, the outer faces stay where they are.
Geometry rescaled(Geometry const& geometry, Index3 from, Index3 to);

/// Throws Error{data} unless everything is finite, spacing positive and the directions independent.
void check(Geometry const& geometry);
/// Equal within a relative tolerance of the spacing (origin) and 1e-6 (spacing ratio, direction cosines).
bool same_geometry(Geometry const& a, Geometry const& b);

} // namespace vkt
