// Where what a picture shows lies: the nearest surface with its normal, or the depth of half of the light.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/exact.h"
#include "libvkt/render/inner/labels.h"

namespace vkt::render {

/// World distance from the eye (perspective) or from the plane through it (orthographic) to a point of a ray.
VKT_HD float distance_of(Ray const& ray, double t) {
    return static_cast<float>((ray.start + t) * ray.world_per_lattice);
}

/// The distance of a point of a ray, and the normal there, of unit length in the world, towards the eye, from the
/// derivative in the lattice.
VKT_HD Radiance place_of(SceneView const& scene, Ray const& ray, double t, Float3 g) {
    Double3 const lattice{g.x, g.y, g.z};
    Matrix3 const& m = scene.to_lattice;
    Double3 normal{dot(m.x, lattice), dot(m.y, lattice), dot(m.z, lattice)}; // gradients map by the transpose
    double const length = std::sqrt(dot(normal, normal));
    double const sign = dot(lattice, ray.direction) > 0 ? -1 : 1;
    normal = length > 0 ? normal * (sign / length) : Double3{0, 0, 0};
    Float3 const n = to_float(normal);
    return {n.x, n.y, n.z, distance_of(ray, t)};
}

/// The nearest surface: its normal in the world, of unit length, towards the eye, and its distance; zeros and infinity
/// where there is none.
template <class S>
VKT_HD Radiance surface_place(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    constexpr float nowhere = std::numeric_limits<float>::infinity();
    if constexpr (VoxelField<S>) {
        if (scene.label_count > 0) {
            LabelHit label;
            if (!meet_label(sampler, scene, ray, label, counters)) return {0, 0, 0, nowhere};
            return place_of(scene, ray, label.t, label_normal(sampler, scene, ray, label));
        }
    }
    Nearest const hit = nearest_surface(sampler, scene, ray, counters);
    if (hit.surface < 0) return {0, 0, 0, nowhere};
    return place_of(scene, ray, hit.t, sampler.gradient(S::place(ray.entry + ray.direction * hit.t)));
}

/// Its colour without light; zeros where there is none.
template <class S>
VKT_HD Radiance surface_albedo(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    if constexpr (VoxelField<S>) {
        if (scene.label_count > 0) {
            LabelHit label;
            if (!meet_label(sampler, scene, ray, label, counters)) return {0, 0, 0, 1};
            IsoView const& shown = shown_as(scene, label.value);
            return {shown.red, shown.green, shown.blue, 0};
        }
    }
    Nearest const hit = nearest_surface(sampler, scene, ray, counters);
    if (hit.surface < 0) return {0, 0, 0, 1};
    IsoView const& iso = scene.isos[hit.surface];
    return {iso.red, iso.green, iso.blue, 0};
}

/// Distance at which half of the light is held back, exact but for rounding; infinity where less is on the whole ray.
template <class S> VKT_HD float half_distance(S const& sampler, SceneView const& scene, Ray const& ray) {
    constexpr double half = 0.69314718055994531; // of the light: optical depth ln 2
    double depth = 0;
    float found = std::numeric_limits<float>::infinity();
    each_piece(
        sampler, scene, ray, true, [&](auto const& piece) __attribute__((always_inline)) {
            if (piece.missing) return true;
            return piece.each_cubic([&](Cubic const& f, double begin, double end) __attribute__((always_inline)) {
                double const world = (end - begin) * piece.width * ray.world_per_lattice;
                return between_knots(
                    scene.bends, scene.bend_count, f, static_cast<double>(piece.least),
                    static_cast<double>(piece.greatest),
                    [&](double from, double to, int i) __attribute__((always_inline)) {
                        KnotGap const gap(scene.bends, scene.bend_count, i);
                        if (!(to > from) || !gap.shows()) return true;
                        double const beyond = depth + gap.depth(f, from, to) * world;
                        if (beyond < half) {
                            depth = beyond;
                            return true;
                        }
                        double const s = gap.place_of_depth(f, (half - depth) / world, from, to);
                        found = distance_of(ray, piece.t + (begin + s * (end - begin)) * piece.width);
                        return false;
                    });
            });
        });
    return found;
}

} // namespace vkt::render
