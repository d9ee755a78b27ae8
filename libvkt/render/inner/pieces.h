// Pieces of a ray along which values are a cubic: the cells of a lattice. Trees cut rays in tree_pieces.h.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/cubic.h"
#include "libvkt/render/inner/scene.h"

namespace vkt::render {

/// The part [t, t + width] of a ray, within one lattice cell.
struct CellPiece {
    double t, width;
    Double3 entry, way; ///< from the lower corner of the cell
    float v[8];         ///< corners, x fastest
    float least, greatest;
    bool missing; ///< some corner has no data, and then the piece has none

    VKT_HD void look() {
        missing = false;
        least = greatest = v[0];
        for (float const c : v) {
            missing = missing || !(c == c);
            least = c < least ? c : least;
            greatest = c > greatest ? c : greatest;
        }
    }
    VKT_HD Cubic cubic() const { return cubic_along(v, entry, way); }
    /// Has the sign of the value less `iso`, as a cubic over [0, 1].
    VKT_HD Cubic difference(double iso) const {
        Cubic f = cubic();
        f.d -= iso;
        return f;
    }
    /// visit(f, from, to): over the share [from, to] of the piece the value is the cubic f over [0, 1]; until it
    /// returns false.
    template <class Visit> VKT_HD bool each_cubic(Visit&& visit) const { return visit(cubic(), 0.0, 1.0); }
};

/// visit(piece) in order along a ray until it returns false. `skip`: not where nothing can be seen.
template <CellSampler S, class Visit>
VKT_HD void each_piece(S const& sampler, SceneView const& scene, Ray const& ray, bool skip, Visit&& visit) {
    CellWalk<double> cells;
    cells.start(ray.entry, ray.direction, ray.length, 0.0, 1.0, 1 << 30, 1 << 30, 1 << 30);
    int const counts[3] = {scene.cells.nx, scene.cells.ny, scene.cells.nz};
    do {
        if (skip) {
            int macrocell[3];
            for (int axis = 0; axis < 3; ++axis) {
                int const from = cells.cell[axis] - static_cast<int>(macrocell_origin);
                int const i = from < 0 ? 0 : from / macrocell_size;
                macrocell[axis] = i < counts[axis] ? i : counts[axis] - 1;
            }
            if (scene.cells.distance[scene.cells.index(macrocell)] > 0) continue;
        }
        CellPiece piece;
        sampler.corners(cells.cell[0], cells.cell[1], cells.cell[2], piece.v);
        piece.look();
        piece.t = cells.t;
        piece.width = cells.leave() - cells.t;
        if (!(piece.width > 0)) continue;
        Double3 const corner{static_cast<double>(cells.cell[0]), static_cast<double>(cells.cell[1]),
                             static_cast<double>(cells.cell[2])};
        piece.entry = ray.entry + ray.direction * piece.t - corner;
        piece.way = ray.direction * piece.width;
        if (!visit(piece)) return;
    } while (cells.advance());
}

/// The pieces within the macrocell that a walk has come to; false if visit(piece) returned that.
template <CellSampler S, class Visit>
VKT_HD bool each_piece_of(S const& sampler, SceneView const&, CellWalk<double> const& outer, Ray const& ray,
                          Visit&& visit) {
    // Same walk, one lattice unit wide, from where the ray enters.
    constexpr double size = macrocell_size;
    Double3 const start = ray.entry + ray.direction * outer.t;
    Double3 const corner{macrocell_origin + size * outer.cell[0], macrocell_origin + size * outer.cell[1],
                         macrocell_origin + size * outer.cell[2]};
    CellWalk<double> inner;
    inner.start(start - corner, ray.direction, outer.leave() - outer.t, 0.0, 1.0, macrocell_size, macrocell_size,
                macrocell_size);
    bool on = true, further = true;
    do {
        CellPiece piece;
        Double3 const cell{corner.x + inner.cell[0], corner.y + inner.cell[1], corner.z + inner.cell[2]};
        sampler.corners(static_cast<int>(cell.x), static_cast<int>(cell.y), static_cast<int>(cell.z), piece.v);
        piece.look();
        piece.t = outer.t + inner.t;
        piece.width = inner.leave() - inner.t;
        piece.entry = ray.entry + ray.direction * piece.t - cell;
        piece.way = ray.direction * piece.width;
        on = goes_on(visit(piece));
        further = inner.advance();
    } while (goes_on(on && further));
    return on;
}

} // namespace vkt::render
