// The reference integrator: double precision, two-point Gauss in every lattice cell, transfer function without a table.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/march.h"

namespace vkt::render {

/// Extinction per world length and colour straight from the knots; constant beyond the ends, zero where there is no
/// data.
VKT_HD Knot evaluate(Knot const* knots, int count, double value) {
    if (!(value == value)) return {value, 0, 0, 0, 0};
    int low = 0, high = count; // the first knot beyond the value
    while (low < high) {
        int const middle = (low + high) / 2;
        if (knots[middle].value > value)
            high = middle;
        else
            low = middle + 1;
    }
    if (low == 0) return knots[0];
    if (low == count) return knots[count - 1];
    Knot const &a = knots[low - 1], &b = knots[low];
    double const f = (value - a.value) / (b.value - a.value);
    return {value, a.extinction + f * (b.extinction - a.extinction), a.red + f * (b.red - a.red),
            a.green + f * (b.green - a.green), a.blue + f * (b.blue - a.blue)};
}

/// Radiance before it is rounded.
struct ExactRadiance {
    double red, green, blue, transmittance;
};

/// Fourth order in the length of the parts: within a lattice cell the value along a ray is a cubic, and extinction is
/// taken as linear through the two Gauss points. Parts are cells cut into pieces no longer than the step.
template <Sampler S>
VKT_HD ExactRadiance exact_integral(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    constexpr double offset = 0.28867513459481287; // 1 / (2 sqrt 3)
    double red = 0, green = 0, blue = 0, depth = 0;
    CellWalk<double> cells;
    cells.start(ray.entry, ray.direction, ray.length, 0.0, 1.0, 1 << 30, 1 << 30, 1 << 30);
    ++counters.rays;
    do {
        double const width = cells.leave() - cells.t;
        int const parts = width > scene.step ? static_cast<int>(std::ceil(width / scene.step - 1e-9)) : 1;
        double const part = width / parts, world = part * ray.world_per_lattice;
        for (int i = 0; i < parts; ++i) {
            double const middle = cells.t + part * (i + 0.5);
            Knot const a = evaluate(scene.knots, scene.knot_count,
                                    sampler.precise(ray.entry + ray.direction * (middle - part * offset)));
            Knot const b = evaluate(scene.knots, scene.knot_count,
                                    sampler.precise(ray.entry + ray.direction * (middle + part * offset)));
            counters.samples += 2;
            ++counters.segments;
            double const through = 0.5 * world * (a.extinction + b.extinction);
            if (!(through > 0)) continue;
            // Depth from the part's begin to a Gauss point, for extinction linear through both points.
            double const slope = (b.extinction - a.extinction) / (2 * offset),
                         centre = 0.5 * (a.extinction + b.extinction);
            auto const depth_to = [&](double s) __attribute__((always_inline)) {
                return world * (centre * s + 0.5 * slope * (s * s - s));
            };
            double const wa = a.extinction * std::exp(-depth_to(0.5 - offset));
            double const wb = b.extinction * std::exp(-depth_to(0.5 + offset));
            double const share = std::exp(-depth) * -std::expm1(-through) / (wa + wb);
            red += share * (wa * a.red + wb * b.red);
            green += share * (wa * a.green + wb * b.green);
            blue += share * (wa * a.blue + wb * b.blue);
            depth += through;
        }
    } while (cells.advance());
    return {red, green, blue, std::exp(-depth)};
}

template <Sampler S>
VKT_HD Radiance exact_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ExactRadiance const r = exact_integral(sampler, scene, ray, counters);
    return {static_cast<float>(r.red), static_cast<float>(r.green), static_cast<float>(r.blue),
            static_cast<float>(r.transmittance)};
}

} // namespace vkt::render
