// The pieces of a ray through a brick tree without a list of the bricks on its way: each is found anew for every piece.
// For GPUs; the same as those of tree_pieces.h.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/stretch_walk.h"
#include "libvkt/render/inner/tree_piece.h"

namespace vkt::render {

/// A ray in the cells of a brick, as BrickWalk counts them: cell i reaches from the centre of the brick's cell i - 1 to
/// that of its cell i.
struct BrickLine {
    Double3 entry, direction;
    double enter, leave; ///< of the brick's domain
    int cell[3];
    double bend; ///< where the ray leaves that cell, or the brick
    float per_finest;
};

/// The pieces within a macrocell, one after the other.
template <class T> struct PieceWalk {
    TreePoints<T, NoScratch> const& points;
    Ray const& ray;
    double t, to, slack, from;
    std::int64_t first, last; ///< of the names of its bricks

    VKT_HD PieceWalk(TreePoints<T, NoScratch> const& of, std::int64_t cell, Ray const& along, double begin,
                     double until)
        : points(of), ray(along), t(begin), to(until), slack(1e-12 * (1 + along.length)), from(begin),
          first(of.tree.cell_first[cell]), last(of.tree.cell_first[cell + 1]) {}

    /// False if the part of the ray in this macrocell does not meet the brick.
    VKT_HD bool meets(SampledBrick const& brick, BrickLine& line) const {
        double const o[3] = {ray.entry.x, ray.entry.y, ray.entry.z},
                     d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
        double entry[3], way[3];
        line.enter = from, line.leave = to;
        bool inside = true;
        for (int a = 0; a < 3; ++a) {
            double const inverse = static_cast<double>(brick.inverse_width[a]);
            entry[a] = (o[a] - brick.lower[a]) * inverse + 0.5;
            way[a] = d[a] * inverse;
            inside = inside &&
                     clip_axis(entry[a], way[a], 0.0, static_cast<double>(brick.dims[a]) + 1, line.enter, line.leave);
        }
        line.entry = {entry[0], entry[1], entry[2]}, line.direction = {way[0], way[1], way[2]};
        float const *const w = brick.inverse_width, xy = w[0] < w[1] ? w[0] : w[1];
        line.per_finest = xy < w[2] ? xy : w[2];
        return inside && line.enter < line.leave;
    }
    /// The brick counts at t. Places that are computed in two ways are the same if they are this close.
    VKT_HD bool is_at(BrickLine const& line) const { return !(line.enter > t + slack) && line.leave > t + slack; }
    /// The cell in which the ray goes on at t.
    VKT_HD void find_cell(SampledBrick const& brick, BrickLine& line) const {
        double const entry[3] = {line.entry.x, line.entry.y, line.entry.z},
                     way[3] = {line.direction.x, line.direction.y, line.direction.z};
        line.bend = line.leave;
        for (int a = 0; a < 3; ++a) {
            int const end = brick.dims[a];
            int i = static_cast<int>(entry[a] + way[a] * t);
            i = i < 0 ? 0 : i > end ? end : i;
            if (way[a] != 0) {
                auto const leave = [&](int of) __attribute__((always_inline)) {
                    return (static_cast<double>(way[a] > 0 ? of + 1 : of) - entry[a]) / way[a];
                };
                double bend = leave(i);
                if (!(bend > t + slack)) {
                    int const next = way[a] > 0 ? i + 1 : i - 1;
                    bool const more = next >= 0 && next <= end;
                    i = more ? next : i;
                    bend = more ? leave(next) : line.leave;
                }
                line.bend = bend < line.bend ? bend : line.bend;
            }
            line.cell[a] = i;
        }
    }

    /// False behind the last one.
    VKT_HD bool next(TreePiece& piece) {
        if (!(t + slack < to)) return false;
        TreeView const& tree = points.tree;
        BrickLine line;
        double end = to;
        float level = 0;
        int active = 0;
        bool one_level = true;
        for (std::int64_t k = first; k < last; ++k) {
            SampledBrick const& brick = tree.bricks[tree.cell_bricks[k]];
            if (!meets(brick, line)) continue;
            if (line.enter > t + slack) end = line.enter < end ? line.enter : end;
            if (!is_at(line)) continue;
            find_cell(brick, line);
            end = line.bend < end ? line.bend : end;
            one_level = one_level && (active == 0 || line.per_finest == level);
            level = line.per_finest;
            ++active;
        }
        piece = {t, end - t, 0, 0, active == 0, {}, {0, 0, 0, 1}, true};
        T const* const cells = static_cast<T const*>(tree.cells);
        detail::Corners corners;
        corners.clear();
        BrickLine lead{}; // its cell is that of all bricks of its level, whatever was rounded
        SampledBrick const* one = nullptr;
        bool none = true;
        for (std::int64_t k = first; k < last && active > 0; ++k) {
            SampledBrick const& brick = tree.bricks[tree.cell_bricks[k]];
            if (!meets(brick, line) || !is_at(line)) continue;
            if (one == nullptr || !one_level) {
                find_cell(brick, line);
                lead = line;
                one = &brick;
                corners.clear();
            }
            int cell[3];
            for (int a = 0; a < 3; ++a)
                cell[a] = lead.cell[a] + static_cast<int>((one->lower[a] - brick.lower[a]) *
                                                          static_cast<double>(brick.inverse_width[a]));
            detail::add_corners(brick, cells, cell, corners);
            --active;
            // Of one level all contribute together, at the last of them.
            if (!one_level || active == 0)
                detail::add_to_piece(lead.entry, lead.direction, lead.cell, corners, one_level, none, piece);
        }
        t = end;
        return true;
    }
};

/// The pieces within the macrocell that a walk has come to; false if visit(piece) returned that.
template <class T, class Visit>
VKT_HD bool each_piece_of(TreePoints<T, NoScratch> const& points, SceneView const& scene, CellWalk<double> const& outer,
                          Ray const& ray, Visit&& visit) {
    PieceWalk<T> pieces(points, scene.cells.index(outer.cell), ray, outer.t, outer.leave());
    TreePiece piece;
    bool on = true;
    while (goes_on(on && pieces.next(piece))) on = visit(piece);
    return on;
}

} // namespace vkt::render
