// A piece of a ray through a brick tree, cut where a weight of its basis reconstruction bends: values are cubics there,
// or ratios.
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

/// Adds what corners contribute to a piece: `entry` and `direction` are the ray's in the cells of their brick, as
/// BrickWalk counts, and `cell` is the one whose corners they are. `whole`: no others contribute; `first`: none did
/// yet.
VKT_HD void add_to_piece(Double3 entry, Double3 direction, int const* cell, Corners& corners, bool whole, bool& first,
                         TreePiece& piece) {
    for (int i = 0; i < 8; ++i) {
        if (!corners.has[i]) continue;
        float const v = corners.v[i];
        piece.missing = piece.missing || !(v == v);
        piece.least = first || v < piece.least ? v : piece.least;
        piece.greatest = first || v > piece.greatest ? v : piece.greatest;
        first = false;
    }
    if (piece.missing) return;
    Double3 const corner{static_cast<double>(cell[0]), static_cast<double>(cell[1]), static_cast<double>(cell[2])};
    Double3 const from = entry + direction * piece.t - corner, way = direction * piece.width;
    if (whole && corners.complete()) {
        piece.sum = cubic_along(corners.v, from, way);
        return;
    }
    if (piece.plain) piece.weight = {0, 0, 0, 0};
    piece.plain = false;
    float there[8];
    for (int i = 0; i < 8; ++i) there[i] = corners.has[i] ? 1.0F : 0.0F;
    piece.sum = added(piece.sum, cubic_along(corners.v, from, way));
    piece.weight = added(piece.weight, cubic_along(there, from, way));
}

} // namespace detail

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
