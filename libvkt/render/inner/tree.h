// A brick tree as rays see it: plain structures of numbers and pointers, alike on CPU and GPU.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/sampler.h"
#include "libvkt/render/inner/scene.h"
#include "libvkt/render/inner/tree_blocks.h"
#include "libvkt/render/tiles.h"

namespace vkt::render {

/// The domain of a brick in finest cells, rounded outwards.
struct BrickBox {
    float lower[3], upper[3];
    std::int32_t id, level;
};

/// Nodes of the transfer table that the values of a brick span; all of them if it has missing cells.
struct BrickNodes {
    std::int32_t first, last;
};

/// What rays need of a hierarchical volume. Positions are in finest cells; the first cell's centre is 0.5.
struct TreeView {
    void const* cells;
    LatticeType type;
    IndexNode const* nodes;
    std::int32_t const* order;
    SampledBrick const* bricks;
    BrickBox const* boxes;               ///< in the order of `order`
    BrickNodes const* range;             ///< per brick
    std::uint32_t const* visible_before; ///< per table node: how many nodes before it show something
    double slack;                        ///< more than what rounding does to positions
    Double3 lower, upper;                ///< box of all domains in which something can be seen; empty if none is
    /// Macrocells, as SceneView::cells has them: cubes of `cell_size` from `cell_origin`; the domains of the bricks
    /// cell_bricks[cell_first[i]…cell_first[i + 1]), ascending, meet cell i.
    Double3 cell_origin;
    double cell_size;
    std::int64_t const* cell_first;
    std::int32_t const* cell_bricks;
    std::int64_t bytes; ///< of all bricks' cells
    BlocksView blocks;  ///< what is marched instead of bricks, if there are any
    double around;      ///< beyond the macrocells in which something can be seen blocks may show something
};

/// The part of a ray that is marched, in lengths from its entry.
struct RayPart {
    double begin, end;
};

/// Part of a ray, up to `end`, that lies in the domains of one set of bricks: `count` ids from `first`, ascending.
/// A sample there is a mean of their cells, so that their common range tells whether anything can be seen.
struct Stretch {
    double end;
    int first, count;
    int level; ///< of the finest brick; in a hole that of what comes next
    bool visible;
    VKT_HD bool hole() const { return count == 0; }
};

/// Coarser than all levels.
inline constexpr int no_level = 62;

namespace detail {

struct Slabs {
    double origin[3], inverse[3], slack;
    RayPart part;

    /// The part of the ray in a box.
    template <class Real> VKT_HD bool cross(Real const* lower, Real const* upper, double& enter, double& leave) const {
        enter = part.begin, leave = part.end;
        for (int a = 0; a < 3; ++a) {
            double const p = (static_cast<double>(lower[a]) - slack - origin[a]) * inverse[a];
            double const q = (static_cast<double>(upper[a]) + slack - origin[a]) * inverse[a];
            double const first = p < q ? p : q, last = p < q ? q : p;
            enter = first > enter ? first : enter;
            leave = last < leave ? last : leave;
        }
        return enter < leave;
    }
};

} // namespace detail

/// How far from a point of a ray nothing can be seen in any direction, by the macrocells; 0 if something may be.
VKT_HD double unseen_from(TreeView const& tree, SceneView const& scene, Ray const& ray, double t) {
    Double3 const p = (ray.entry + ray.direction * t - tree.cell_origin) * (1 / tree.cell_size);
    double const place[3] = {p.x, p.y, p.z};
    int const count[3] = {scene.cells.nx, scene.cells.ny, scene.cells.nz};
    int cell[3];
    for (int a = 0; a < 3; ++a) {
        if (!(place[a] >= 0 && place[a] < count[a])) return 0;
        cell[a] = static_cast<int>(place[a]);
    }
    int const distance = scene.cells.distance[scene.cells.index(cell)];
    return distance > 1 ? (distance - 1) * tree.cell_size : 0;
}

} // namespace vkt::render
