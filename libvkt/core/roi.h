// Regions as users write them: "X0:X1,Y0:Y1,Z0:Z1", half-open, with edges, negatives, sizes and per cent.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/core/types.h"

#include <string>
#include <string_view>

namespace vkt {

inline constexpr std::int64_t max_roi_extent = std::int64_t{1} << 40;

/// Every step-th voxel of a box, counted from its lower corner; the upper corner lies right behind the last of them.
struct SteppedBox {
    Box box;
    Index3 step{1, 1, 1};

    bool dense() const { return step == Index3{1, 1, 1}; }
    Index3 dims() const; ///< how many voxels are taken
    /// What voxels of the result are made of: the smallest box that holds those taken for `result`.
    Box source(Box const& result) const;
    /// Of the voxels that are taken, which stay where they are: the spacing grows with the step.
    Geometry geometry(Geometry const& whole) const;
};

std::string to_text(SteppedBox const& region); ///< "x0:x1:s,y0:y1,z0:z1", steps of 1 left out

/// One range per axis. "" is the edge, "-3" counts from the end, "A:+N" is N voxels from A, "25%" is a share of the
/// extent (rounded to the nearest voxel), a single "7" is the slice 7:8. "A:B:S" is every S-th voxel from A on, as
/// NumPy has it.
struct Roi {
    std::string text;
    std::string option = "--roi"; ///< where it was given, for errors
    bool empty() const { return text.empty(); }
    bool has_steps() const; ///< a range has a second colon
    /// The box in a volume of these dims. Throws Error{usage} if it is malformed, empty, or leaves the volume, or has
    /// steps.
    Box resolve(Index3 dims) const;
    /// The same with steps from 1 on.
    SteppedBox resolve_steps(Index3 dims) const;
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
