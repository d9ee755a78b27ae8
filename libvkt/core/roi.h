// Regions as users write them: "X0:X1,Y0:Y1,Z0:Z1", half-open, with edges, negatives, sizes and per cent.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/core/types.h"

#include <string>
#include <string_view>

namespace vkt {

inline constexpr std::int64_t max_roi_extent = std::int64_t{1} << 40;

/// One range per axis. "" is the edge, "-3" counts from the end, "A:+N" is N voxels from A, "25%" is a share of the
/// extent (rounded to the nearest voxel), a single "7" is the slice 7:8.
struct Roi {
    std::string text;
    bool empty() const { return text.empty(); }
    /// The box in a volume of these dims. Throws Error{usage} if it is malformed, empty, or leaves the volume.
    Box resolve(Index3 dims) const;
};

/// volkit's way to name a region: from voxel `first` up to, not including, voxel `last`.
Roi roi_of(Index3 first, Index3 last);

/// The same in world coordinates: "X0:X1,Y0:Y1,Z0:Z1" in world units; an open bound reaches the edge.
struct WorldRoi {
    std::string text;
    bool empty() const { return text.empty(); }
    /// The voxels whose centres lie in the region, as a box (oblique volumes: its bounding box). Throws Error{usage} if
    /// it is malformed or meets no voxel.
    Box resolve(Geometry const& geometry, Index3 dims) const;
};

} // namespace vkt
