// A ray through a brick tree, cut where a weight of its basis reconstruction bends: values are cubics there, or ratios.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/pieces.h"
#include "libvkt/render/inner/tree_points.h"

namespace vkt::render {

/// The part [t, t + width] of a ray along which no cell's weight bends. Where one level alone counts, values are those
/// of a lattice cell; where levels meet they are a ratio of cubics: weighted values over weights.
struct TreePiece {
    double t, width;
    float least, greatest; ///< of all cells that count
    bool missing;          ///< some of them have no data, or there are none
    Cubic sum, weight;     ///< over [0, 1]; the weight is 1 where `plain`
    bool plain;

    VKT_HD double value(double s) const {
        double const w = weight(s), v = w > 1e-12 ? sum(s) / w : static_cast<double>(least);
        double const low = least, high = greatest;
        return v < low ? low : v > high ? high : v; // it is a mean
    }
    VKT_HD Cubic difference(double iso) const {
        if (plain) return {sum.a, sum.b, sum.c, sum.d - iso};
        return {sum.a - iso * weight.a, sum.b - iso * weight.b, sum.c - iso * weight.c, sum.d - iso * weight.d};
    }
    /// Ratios become cubics through four of their points, over parts so short that three points between are met to
    /// 1e-7 of the range, or that are the 64th part.
    template <class Visit> VKT_HD bool each_cubic(Visit&& visit) const {
        double length = 1;
        for (double from = 0; from < 1; from += length) {
            Cubic const f = plain ? sum : part(from, length);
            if (!visit(f, from, from + length)) return false;
        }
        return true;
    }

private:
    /// The next part; `length` is that of the one before.
    VKT_HD Cubic part(double from, double& length) const {
        double const allowed = 1e-7 * (static_cast<double>(greatest) - static_cast<double>(least));
        while (length < 1 && std::fmod(from, 2 * length) == 0) length *= 2;
        while (true) {
            Cubic const f = through(from, length);
            bool const fits = off(f, from, length, 1.0 / 6) <= allowed && off(f, from, length, 0.5) <= allowed &&
                              off(f, from, length, 5.0 / 6) <= allowed;
            if (fits || length <= 1.0 / 64) return f;
            length *= 0.5;
        }
    }
    VKT_HD Cubic through(double from, double length) const {
        double const p = value(from), q = value(from + length / 3), r = value(from + length * 2 / 3),
                     s = value(from + length);
        return {4.5 * (s - p + 3 * (q - r)), 4.5 * (2 * p - 5 * q + 4 * r - s), 0.5 * (18 * q - 11 * p - 9 * r + 2 * s),
                p};
    }
    VKT_HD double off(Cubic const& f, double from, double length, double at) const {
        return std::abs(f(at) - value(from + length * at));
    }
};

namespace detail {

/// Corners of one cell of a level's lattice, of which some may not be there.
struct Corners {
    float v[8];
    bool has[8];
    int count;

    VKT_HD void clear() {
        for (int i = 0; i < 8; ++i) v[i] = 0, has[i] = false;
        count = 0;
    }
    /// Fills in what is missing from what is there, along one axis after the other, which is what dividing by the
    /// weight makes of a border; false where corners are missing that no border takes away, such as one alone.
    VKT_HD bool complete() {
        if (count == 8) return true;
        bool some[3][2] = {};
        for (int i = 0; i < 8; ++i)
            for (int a = 0; a < 3; ++a) some[a][i >> a & 1] = some[a][i >> a & 1] || has[i];
        for (int i = 0; i < 8; ++i)
            if (has[i] != (some[0][i & 1] && some[1][i >> 1 & 1] && some[2][i >> 2])) return false;
        bool filled[8];
        for (int i = 0; i < 8; ++i) filled[i] = has[i];
        for (int a = 0; a < 3; ++a)
            for (int i = 0; i < 8; ++i) {
                int const other = i ^ (1 << a);
                if (some[a][i >> a & 1] || !filled[other]) continue;
                v[i] = v[other];
                filled[i] = true;
            }
        return true;
    }
};

/// Adds the corners of a brick's cell (as BrickWalk counts) to those of others of its level.
template <class T> VKT_HD void add_corners(SampledBrick const& brick, T const* cells, int const* cell, Corners& all) {
    for (int i = 0; i < 8; ++i) {
        int at[3];
        bool inside = true;
        for (int a = 0; a < 3; ++a) {
            at[a] = cell[a] - 1 + (i >> a & 1);
            inside = inside && at[a] >= 0 && at[a] < brick.dims[a];
        }
        if (!inside || all.has[i]) continue;
        all.v[i] = static_cast<float>(
            cells[brick.offset + (static_cast<std::int64_t>(at[2]) * brick.dims[1] + at[1]) * brick.dims[0] + at[0]]);
        all.has[i] = true;
        ++all.count;
    }
}

VKT_HD Cubic added(Cubic const& f, Cubic const& g) { return {f.a + g.a, f.b + g.b, f.c + g.c, f.d + g.d}; }

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
        T const* const cells = static_cast<T const*>(points.tree.cells);
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
            detail::add_corners(brick, cells, cell, corners);
            if (!one_level) put(*lead, corners, false, first, piece);
        }
        if (active > 0 && one_level) put(*lead, corners, true, first, piece);
        t = end;
        return true;
    }

private:
    static void put(BrickWalk const& w, detail::Corners& corners, bool whole, bool& first, TreePiece& piece) {
        for (int i = 0; i < 8; ++i) {
            if (!corners.has[i]) continue;
            float const v = corners.v[i];
            piece.missing = piece.missing || !(v == v);
            piece.least = first || v < piece.least ? v : piece.least;
            piece.greatest = first || v > piece.greatest ? v : piece.greatest;
            first = false;
        }
        if (piece.missing) return;
        Double3 const corner{static_cast<double>(w.walk.cell[0]), static_cast<double>(w.walk.cell[1]),
                             static_cast<double>(w.walk.cell[2])};
        Double3 const entry = w.entry + w.direction * piece.t - corner, way = w.direction * piece.width;
        if (whole && corners.complete()) {
            piece.sum = cubic_along(corners.v, entry, way);
            return;
        }
        if (piece.plain) piece.weight = {0, 0, 0, 0};
        piece.plain = false;
        float there[8];
        for (int i = 0; i < 8; ++i) there[i] = corners.has[i] ? 1.0F : 0.0F;
        piece.sum = detail::added(piece.sum, cubic_along(corners.v, entry, way));
        piece.weight = detail::added(piece.weight, cubic_along(there, entry, way));
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

/// visit(piece) in order along a ray until it returns false. `skip`: not where nothing can be seen.
template <class T, class Scratch, class Visit>
VKT_HD void each_piece(TreePoints<T, Scratch> const& points, SceneView const& scene, Ray const& ray, bool skip,
                       Visit&& visit) {
    CellWalk<double> outer;
    outer.start(ray.entry - points.cell_origin(), ray.direction, ray.length, 0.0, points.cell_size(), scene.cells.nx,
                scene.cells.ny, scene.cells.nz);
    int distance = 0;
    do {
        distance = skip ? scene.cells.distance[scene.cells.index(outer.cell)] : 0;
        if (distance > 0) continue;
        if (!each_piece_of(points, scene, outer, ray, visit)) return;
    } while (outer.leap(distance));
}

} // namespace vkt::render
