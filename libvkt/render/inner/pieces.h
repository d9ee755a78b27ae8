// Pieces of a ray along which values are a cubic: the cells of a lattice. Trees cut rays in tree_pieces.h.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/cubic.h"
#include "libvkt/render/inner/scene.h"

#include <cstdint>
#include <cstring>

namespace vkt::render {

/// Whether a sampler says that it has no voxels without data.
template <class S> VKT_HD bool all_there(S const& sampler) {
    if constexpr (requires { sampler.all_there(); }) return sampler.all_there();
    return false;
}

/// The part [t, t + width] of a ray, within one lattice cell.
struct CellPiece {
    Double3 begin, direction; ///< of the ray
    int cell[3];
    double t, width;
    alignas(16) float v[8]; ///< corners, x fastest
    float least, greatest;
    bool missing; ///< some corner has no data, and then the piece has none

    /// `known`: no corner is NaN.
    VKT_HD void look([[maybe_unused]] bool known) {
#ifndef __CUDACC__
        // A loop over eight becomes a chain of comparisons, each of which waits for the one before.
        using Mask = std::int32_t __attribute__((vector_size(16)));
        Quad low, high;
        std::memcpy(&low, v, sizeof low);
        std::memcpy(&high, v + 4, sizeof high);
        Quad less = low < high ? low : high, more = low > high ? low : high;
        auto const halves = [](Quad q) __attribute__((always_inline)) {
            return __builtin_shufflevector(q, q, 2, 3, 0, 1);
        };
        auto const ones = [](Quad q) __attribute__((always_inline)) {
            return __builtin_shufflevector(q, q, 1, 0, 3, 2);
        };
        Quad const less2 = halves(less), more2 = halves(more);
        less = less < less2 ? less : less2, more = more > more2 ? more : more2;
        Quad const less1 = ones(less), more1 = ones(more);
        least = less[0] < less1[0] ? less[0] : less1[0];
        greatest = more[0] > more1[0] ? more[0] : more1[0];
        Mask const none = (low != low) | (high != high); // NOLINT(misc-redundant-expression): NaN
        std::uint64_t words[2];
        std::memcpy(words, &none, sizeof words);
        missing = !known && (words[0] | words[1]) != 0;
#else
        missing = false;
        least = greatest = v[0];
        for (float const c : v) {
            missing = missing || !(c == c);
            least = c < least ? c : least;
            greatest = c > greatest ? c : greatest;
        }
#endif
    }
    VKT_HD Cubic cubic() const {
        Double3 const corner{static_cast<double>(cell[0]), static_cast<double>(cell[1]), static_cast<double>(cell[2])};
        return cubic_along(v, begin + direction * t - corner, direction * width);
    }
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
        double const width = cells.leave() - cells.t;
        if (!(width > 0)) continue;
        CellPiece piece{ray.entry, ray.direction, {cells.cell[0], cells.cell[1], cells.cell[2]}, cells.t, width, {}, 0,
                        0,         false};
        sampler.corners(piece.cell[0], piece.cell[1], piece.cell[2], piece.v);
        piece.look(all_there(sampler));
        if (!visit(piece)) return;
    } while (cells.advance());
}

/// The pieces within the macrocell that a walk has come to; false if visit(piece) returned that.
template <CellSampler S, class Visit>
VKT_HD bool each_piece_of(S const& sampler, SceneView const&, CellWalk<double> const& outer, Ray const& ray,
                          Visit&& visit) {
    // Same walk, one lattice unit wide, from where the ray enters.
    Double3 const start = ray.entry + ray.direction * outer.t;
    constexpr int origin = static_cast<int>(macrocell_origin);
    int const corner[3] = {origin + macrocell_size * outer.cell[0], origin + macrocell_size * outer.cell[1],
                           origin + macrocell_size * outer.cell[2]};
    CellWalk<double> inner;
    inner.start_within(
        outer,
        start - Double3{static_cast<double>(corner[0]), static_cast<double>(corner[1]), static_cast<double>(corner[2])},
        outer.leave() - outer.t, macrocell_size);
    bool on = true, further = true;
    do {
        CellPiece piece{ray.entry,
                        ray.direction,
                        {corner[0] + inner.cell[0], corner[1] + inner.cell[1], corner[2] + inner.cell[2]},
                        outer.t + inner.t,
                        inner.leave() - inner.t,
                        {},
                        0,
                        0,
                        false};
        sampler.corners(piece.cell[0], piece.cell[1], piece.cell[2], piece.v);
        piece.look(all_there(sampler));
        on = goes_on(visit(piece));
        further = inner.advance();
    } while (goes_on(on && further));
    return on;
}

} // namespace vkt::render
