// The part of a volume that a picture is to show: from macrocells, and from what is in those that it ends in.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/render/camera.h"
#include "libvkt/render/lattice.h"
#include "libvkt/render/tree.h"

#include <functional>
#include <vector>

namespace vkt::render {

/// Macrocells, and the parts that they can be divided into: cubes of a power of two of parts. Part (i, j, k) begins at
/// `first + width * (i, j, k)`, where the centre of the first voxel is (0, 0, 0).
struct CellParts {
    Index3 counts, origin;       ///< macrocells, and the part that they begin with
    std::int64_t size = 1;       ///< parts along a macrocell
    double width = 1, first = 0; ///< in voxels
    /// What is interpolated in a box of parts, within one macrocell, lies in this range.
    std::function<PartRange(Box const&)> range;
};
/// Those of a lattice, down to a cell of it between voxels, or if it is drawn voxel by voxel to half a voxel; and of a
/// tree, down to half a cell. What they are made of has to stay.
CellParts parts_of(Lattice const& lattice, bool by_voxels);
CellParts parts_of(Tree const& tree);

/// How far a volume can be seen: what an interpolated value in reach of something visible touches, to a part. Where
/// there is no data nothing is seen. A question takes time that grows with the macrocells of a face, and those are
/// looked into that may hold the answer.
class VisibleContent : public Shown {
public:
    /// `seen`: whether something of a range of sampled values can be seen.
    VisibleContent(CellVisibility const& cells, CellParts parts, std::function<bool(float, float)> seen,
                   Geometry const& geometry, Box const& within);

    bool any() const;
    double reach(Vec3 direction) const override;
    double radius(Vec3 from) const override;
    /// The corners of the smallest box along the axes of the volume that holds it, in the world.
    std::vector<Vec3> corners() const;

private:
    class Search;
    struct Row {
        Index3 first; ///< visible macrocell
        std::int64_t last;
    };
    /// In voxels, along a direction of them; lowest if there is nothing.
    double reach_in_voxels(Vec3 direction) const;
    bool visible(Index3 cell) const;

    CellVisibility const& cells_;
    CellParts parts_;
    std::function<bool(float, float)> seen_;
    Geometry geometry_;
    Vec3 lower_, upper_; ///< of what is shown, in voxels
    std::vector<Row> rows_;
};

} // namespace vkt::render
