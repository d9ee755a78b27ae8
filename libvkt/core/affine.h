// Affine maps of index coordinates: between lattices and the world, and the voxels whose images lie in a box.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"

#include <array>

namespace vkt {

/// p becomes offset + sum over the axes a of column[a] * p[a].
struct Affine {
    std::array<Vec3, 3> column{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    Vec3 offset;

    Vec3 operator()(Vec3 p) const { return offset + column[0] * p.x + column[1] * p.y + column[2] * p.z; }
    friend bool operator==(Affine const&, Affine const&) = default;
};

/// One map after another: first `inner`.
Affine composed(Affine const& outer, Affine const& inner);
Affine index_to_world(Geometry const& geometry);
/// From voxels of one lattice to those of another in the same world. Origins are subtracted before anything else, so
/// that large ones cost no digits. Throws Error{data} if the directions of `to` are linearly dependent.
Affine index_to_index(Geometry const& from, Geometry const& to);
/// Throws Error{data} if the columns are linearly dependent.
Affine inverse(Affine const& map);

/// The smallest box that holds every voxel of [0, dims) whose image lies in [lower, upper] along each axis of the
/// image, where bounds may be infinite; empty if there is none. Of lattices turned against the image rows are searched
/// for voxels, from each face inwards: O(extent) where a face is met at once, as nearly always. After 2^28 rows the box
/// may be larger than the smallest.
Box voxels_within(Affine const& map, Vec3 lower, Vec3 upper, Index3 dims);

} // namespace vkt
