// The pieces of a ray through a brick tree, with the bricks of a macrocell in a list.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/tree_lists.h"
#include "libvkt/render/inner/tree_piece.h"

namespace vkt::render {

namespace detail {

/// The bricks of a macrocell that the part [from, to] of a ray crosses.
template <class T, class Scratch>
__attribute__((noinline)) void walk_bricks(TreePoints<T, Scratch> const& points, std::int64_t cell, double from,
                                           double to, Ray const& ray) {
    TreeView const& tree = points.tree;
    Growing<BrickWalk>& walks = points.scratch.walks;
    walks.size = 0;
    double const o[3] = {ray.entry.x, ray.entry.y, ray.entry.z},
                 d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
    for (std::int64_t k = tree.cell_first[cell]; k < tree.cell_first[cell + 1]; ++k) {
        std::int32_t const id = tree.cell_bricks[k];
        SampledBrick const& brick = tree.bricks[id];
        double entry[3], way[3], enter = from, leave = to;
        bool meets = true;
        for (int a = 0; a < 3 && meets; ++a) {
            double const inverse = static_cast<double>(brick.inverse_width[a]);
            entry[a] = (o[a] - brick.lower[a]) * inverse + 0.5;
            way[a] = d[a] * inverse;
            meets = clip_axis(entry[a], way[a], 0.0, static_cast<double>(brick.dims[a]) + 1, enter, leave);
        }
        if (!meets || !(enter < leave)) continue;
        float const *const w = brick.inverse_width, xy = w[0] < w[1] ? w[0] : w[1];
        BrickWalk walk{
            enter, leave, id, xy < w[2] ? xy : w[2], {entry[0], entry[1], entry[2]}, {way[0], way[1], way[2]}, {}};
        walk.walk.start(walk.entry + walk.direction * enter, walk.direction, leave - enter, 0.0, 1.0, brick.dims[0] + 1,
                        brick.dims[1] + 1, brick.dims[2] + 1);
        walks.push(walk);
    }
}

} // namespace detail

/// The pieces of a ray within a macrocell, one after the other.
template <class T, class Scratch> struct TreePieces {
    TreePoints<T, Scratch> const& points;
    Ray const& ray;
    double t, to, slack;

    TreePieces(TreePoints<T, Scratch> const& of, std::int64_t cell, Ray const& along, double from, double until)
        : points(of), ray(along), t(from), to(until), slack(1e-12 * (1 + along.length)) {
        detail::walk_bricks(points, cell, from, to, ray);
    }

    /// Places that are computed in two ways are the same if they are this close.
    bool is_at(BrickWalk const& w) const { return !(w.enter > t + slack) && w.leave > t + slack; }

    /// Moves all bricks on to t; returns where the first of them bends next. `active`: how many there are.
    double move_on(int& active, bool& one_level) {
        double end = to;
        float level = 0;
        active = 0, one_level = true;
        Growing<BrickWalk>& walks = points.scratch.walks;
        for (int i = 0; i < walks.size; ++i) {
            BrickWalk& w = walks.items[i];
            if (w.enter > t + slack) end = w.enter < end ? w.enter : end;
            if (!is_at(w)) continue;
            while (w.enter + w.walk.leave() <= t + slack && w.walk.advance()) {
            }
            double const leave = w.enter + w.walk.leave(), own = leave > t + slack ? leave : w.leave;
            end = own < end ? own : end;
            one_level = one_level && (active == 0 || w.per_finest == level);
            level = w.per_finest;
            ++active;
        }
        return end;
    }

    /// False behind the last one.
    __attribute__((noinline)) bool next(TreePiece& piece) {
        if (!(t + slack < to)) return false;
        int active;
        bool one_level;
        double const end = move_on(active, one_level);
        piece = {t, end - t, 0, 0, active == 0, {}, {0, 0, 0, 1}, true};
        Growing<BrickWalk> const& walks = points.scratch.walks;
        detail::Corners corners;
        BrickWalk const* lead = nullptr; // its cell is that of all bricks of its level, whatever was rounded
        bool first = true;
        for (int i = 0; i < walks.size && active > 0; ++i) {
            BrickWalk const& w = walks.items[i];
            if (!is_at(w)) continue;
            if (lead == nullptr || !one_level) {
                lead = &w;
                corners.clear();
            }
            SampledBrick const &brick = points.tree.bricks[w.id], &one = points.tree.bricks[lead->id];
            int cell[3];
            for (int a = 0; a < 3; ++a)
                cell[a] = lead->walk.cell[a] + static_cast<int>((one.lower[a] - brick.lower[a]) *
                                                                static_cast<double>(brick.inverse_width[a]));
            with_voxel_type<T>(
                points.tree.type, [&]<class V>(V) __attribute__((always_inline)) {
                    detail::add_corners(brick, static_cast<V const*>(points.tree.cells), cell, corners);
                });
            if (!one_level) put(*lead, corners, false, first, piece);
        }
        if (active > 0 && one_level) put(*lead, corners, true, first, piece);
        t = end;
        return true;
    }

private:
    static void put(BrickWalk const& w, detail::Corners& corners, bool whole, bool& first, TreePiece& piece) {
        detail::add_to_piece(w.entry, w.direction, w.walk.cell, corners, whole, first, piece);
    }
};

/// The pieces within the macrocell that a walk has come to; false if visit(piece) returned that.
template <class T, class Scratch, class Visit>
VKT_HD bool each_piece_of(TreePoints<T, Scratch> const& points, SceneView const& scene, CellWalk<double> const& outer,
                          Ray const& ray, Visit&& visit) {
    TreePieces<T, Scratch> pieces(points, scene.cells.index(outer.cell), ray, outer.t, outer.leave());
    TreePiece piece;
    while (pieces.next(piece))
        if (!visit(piece)) return false;
    return true;
}

} // namespace vkt::render
