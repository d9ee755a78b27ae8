// Projections: the greatest, least or mean value along a ray, exactly, cell by cell.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/exact.h"

namespace vkt::render {

/// Values along a ray are cubics in every cell, whose ends and extrema are compared and whose integral is exact. The
/// colour is that of the value; rays without any value show nothing.
template <class S>
VKT_HD Radiance project_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ++counters.rays;
    bool const greatest = scene.projection == Projected::greatest, mean = scene.projection == Projected::mean;
    double best = 0, length = 0;
    auto const meet = [&](double value) __attribute__((always_inline)) {
        if (!(length > 0) || (greatest ? value > best : value < best)) best = value;
    };
    each_piece(
        sampler, scene, ray, false, [&](auto const& piece) __attribute__((always_inline)) {
            ++counters.samples;
            if (piece.missing) return true;
            // A cell whose corners do not reach further cannot either.
            if (!mean && length > 0 &&
                (greatest ? static_cast<double>(piece.greatest) <= best : static_cast<double>(piece.least) >= best))
                return true;
            ++counters.segments;
            return piece.each_cubic([&](Cubic const& f, double from, double to) __attribute__((always_inline)) {
                if (mean) {
                    double const width = (to - from) * piece.width;
                    best += width * (f.d + f.c / 2 + f.b / 3 + f.a / 4);
                    length += width;
                    return true;
                }
                double at[2];
                int const n = extrema(f, at);
                meet(f(0.0));
                length = 1;
                meet(f(1.0));
                for (int i = 0; i < n; ++i) meet(f(at[i]));
                return true;
            });
        });
    if (!(length > 0)) return {0, 0, 0, 1};
    Knot const shown = evaluate(scene.knots, scene.knot_count, mean ? best / length : best);
    return {static_cast<float>(shown.red), static_cast<float>(shown.green), static_cast<float>(shown.blue), 0};
}

} // namespace vkt::render
