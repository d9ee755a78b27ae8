// Where what a picture shows lies: the nearest surface with its normal, or the depth of half of the light.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/exact.h"
#include "libvkt/render/inner/iso.h"

namespace vkt::render {

/// World distance from the eye (perspective) or from the plane through it (orthographic) to a point of a ray.
VKT_HD float distance_of(Ray const& ray, double t) {
    return static_cast<float>((ray.start + t) * ray.world_per_lattice);
}

/// The nearest surface: its normal in the world, of unit length, towards the eye, and its distance; zeros and infinity
/// where there is none.
template <CellSampler S>
VKT_HD Radiance surface_place(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    Nearest const hit = nearest_surface(sampler, scene, ray, counters);
    if (hit.surface < 0) return {0, 0, 0, std::numeric_limits<float>::infinity()};
    Float3 const g = sampler.gradient(to_float(ray.entry + ray.direction * hit.t));
    Double3 const lattice{g.x, g.y, g.z};
    Matrix3 const& m = scene.to_lattice;
    Double3 normal{dot(m.x, lattice), dot(m.y, lattice), dot(m.z, lattice)}; // gradients map by the transpose
    double const length = std::sqrt(dot(normal, normal));
    double const sign = dot(lattice, ray.direction) > 0 ? -1 : 1;
    normal = length > 0 ? normal * (sign / length) : Double3{0, 0, 0};
    Float3 const n = to_float(normal);
    return {n.x, n.y, n.z, distance_of(ray, hit.t)};
}

/// Its colour without light; zeros where there is none.
template <CellSampler S>
VKT_HD Radiance surface_albedo(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    Nearest const hit = nearest_surface(sampler, scene, ray, counters);
    if (hit.surface < 0) return {0, 0, 0, 1};
    IsoView const& iso = scene.isos[hit.surface];
    return {iso.red, iso.green, iso.blue, 0};
}

/// Distance at which half of the light is held back, exact but for rounding; infinity where less is on the whole ray.
template <CellSampler S>
VKT_HD float half_distance(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    constexpr double half = 0.69314718055994531; // of the light: optical depth ln 2
    ExactMarch march{scene.knots, scene.knot_count, &counters};
    CellWalk<double> cells;
    cells.start(ray.entry, ray.direction, ray.length, 0.0, 1.0, 1 << 30, 1 << 30, 1 << 30);
    int const counts[3] = {scene.cells.nx, scene.cells.ny, scene.cells.nz};
    do {
        int macrocell[3];
        for (int axis = 0; axis < 3; ++axis) {
            int const from = cells.cell[axis] - static_cast<int>(macrocell_origin);
            int const i = from < 0 ? 0 : from / macrocell_size;
            macrocell[axis] = i < counts[axis] ? i : counts[axis] - 1;
        }
        if (scene.cells.distance[scene.cells.index(macrocell)] > 0) continue;
        float v[8];
        sampler.corners(cells.cell[0], cells.cell[1], cells.cell[2], v);
        bool missing = false;
        float least = v[0], greatest = v[0];
        for (float const c : v) {
            missing = missing || !(c == c);
            least = c < least ? c : least;
            greatest = c > greatest ? c : greatest;
        }
        double const width = cells.leave() - cells.t;
        if (missing || !(width > 0)) continue;
        Double3 const corner{static_cast<double>(cells.cell[0]), static_cast<double>(cells.cell[1]),
                             static_cast<double>(cells.cell[2])};
        Double3 const entry = ray.entry + ray.direction * cells.t - corner;
        auto const depth_to = [&](double share) __attribute__((always_inline)) {
            ExactMarch part = march;
            double const way = share * width;
            part.add_cell(cubic_along(v, entry, ray.direction * way), static_cast<double>(least),
                          static_cast<double>(greatest), way * ray.world_per_lattice);
            return part.depth;
        };
        double const depth = depth_to(1);
        if (depth < half) {
            march.depth = depth;
            continue;
        }
        double low = 0, high = 1;
        for (int i = 0; i < 30; ++i) {
            double const middle = 0.5 * (low + high);
            (depth_to(middle) < half ? low : high) = middle;
        }
        return distance_of(ray, cells.t + high * width);
    } while (cells.advance());
    return std::numeric_limits<float>::infinity();
}

} // namespace vkt::render
