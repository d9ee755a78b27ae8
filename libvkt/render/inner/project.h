// Projections: the greatest, least or mean value along a ray, exactly, cell by cell.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/exact.h"

namespace vkt::render {

/// Values along a ray are cubics in every cell, whose ends and extrema are compared and whose integral is exact. The
/// colour is that of the value; rays without any value show nothing.
template <CellSampler S>
VKT_HD Radiance project_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ++counters.rays;
    CellWalk<double> cells;
    cells.start(ray.entry, ray.direction, ray.length, 0.0, 1.0, 1 << 30, 1 << 30, 1 << 30);
    bool const greatest = scene.projection == Projected::greatest, mean = scene.projection == Projected::mean;
    double best = 0, length = 0;
    auto const meet = [&](double value) __attribute__((always_inline)) {
        if (!(length > 0) || (greatest ? value > best : value < best)) best = value;
    };
    do {
        float v[8];
        sampler.corners(cells.cell[0], cells.cell[1], cells.cell[2], v);
        ++counters.samples;
        float low = v[0], high = v[0];
        bool missing = false;
        for (float const c : v) {
            missing = missing || !(c == c);
            low = c < low ? c : low;
            high = c > high ? c : high;
        }
        double const width = cells.leave() - cells.t;
        if (missing || !(width > 0)) continue;
        // A cell whose corners do not reach further cannot either.
        if (!mean && length > 0 && (greatest ? static_cast<double>(high) <= best : static_cast<double>(low) >= best))
            continue;
        Double3 const corner{static_cast<double>(cells.cell[0]), static_cast<double>(cells.cell[1]),
                             static_cast<double>(cells.cell[2])};
        Cubic const f = cubic_along(v, ray.entry + ray.direction * cells.t - corner, ray.direction * width);
        ++counters.segments;
        if (mean) {
            best += width * (f.d + f.c / 2 + f.b / 3 + f.a / 4);
            length += width;
            continue;
        }
        double at[2];
        int const n = extrema(f, at);
        meet(f(0.0));
        length = 1;
        meet(f(1.0));
        for (int i = 0; i < n; ++i) meet(f(at[i]));
    } while (cells.advance());
    if (!(length > 0)) return {0, 0, 0, 1};
    Knot const shown = evaluate(scene.knots, scene.knot_count, mean ? best / length : best);
    return {static_cast<float>(shown.red), static_cast<float>(shown.green), static_cast<float>(shown.blue), 0};
}

} // namespace vkt::render
