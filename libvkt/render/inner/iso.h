// Implicit iso-surfaces: the cubic along the ray is solved in every cell, sides are carried so that nothing leaks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/march.h"
#include "libvkt/render/inner/pieces.h"

namespace vkt::render {

/// Side of a surface: at or above the iso-value, below it, or not known (no data).
enum class Side : std::uint8_t { unknown, below, above };
VKT_HD Side side_of(double difference) { return difference >= 0 ? Side::above : Side::below; }

/// Where a ray crosses a surface, yet to be worked out: at t + s * width, s between s0 and s1 a zero of the cubic,
/// which is f0 and f1 there.
struct Crossed {
    double t, width;
    Cubic cubic;
    double s0, s1, f0, f1;
    VKT_HD double place() const { return t + crossing(cubic, s0, s1, f0, f1) * width; }
};
/// The same where that is known.
VKT_HD Crossed crossed_at(double t) { return {t, 0, {0, 0, 0, 0}, 0, 0, 0, 0}; }

/// Finds all crossings within one cell, [t, t + width] of the ray, beginning on the carried side; calls hit(crossed,
/// new side) until it returns false. Returns false if it was told to stop. The side after the cell is left in `side`.
template <class Hit> VKT_HD bool cross_cell(Cubic f, double iso, double t, double width, Side& side, Hit&& hit) {
    f.d -= iso;
    double const begin = f.d, end = f(1.0);
    if (side == Side::unknown) side = side_of(begin);
    // Rounding may put the entry on the other side than the exit of the cell before: then it is crossed right here.
    if (side_of(begin) != side) {
        side = side_of(begin);
        if (!hit(crossed_at(t), side)) return false;
    }
    // Most cells that values on both sides meet are not crossed.
    if (stays(f, end, side == Side::above)) return true;
    // Between extrema the cubic is monotone and crosses at most once.
    double cuts[3];
    int n = is_monotone(f) ? 0 : extrema(f, cuts);
    cuts[n++] = 1.0;
    double s0 = 0, f0 = begin;
    for (int i = 0; i < n; ++i) {
        double const f1 = i == n - 1 ? end : f(cuts[i]);
        if (side_of(f1) != side) {
            side = side_of(f1);
            if (!hit(Crossed{t, width, f, s0, cuts[i], f0, f1}, side)) return false;
        }
        s0 = cuts[i], f0 = f1;
    }
    return true;
}

/// All crossings of one iso-value along a ray in the order of the cells: hit(crossed, side behind) until it returns
/// false.
template <ScalarField S, class Hit>
VKT_HD void cross_cells(S const& sampler, SceneView const& scene, Ray const& ray, double iso, Counters& counters,
                        Hit&& hit) {
    CellWalk<double> outer;
    typename S::Vector const origin = sampler.cell_origin();
    outer.start(ray.entry - Double3{origin.x, origin.y, origin.z}, ray.direction, ray.length, 0.0,
                static_cast<double>(sampler.cell_size()), scene.cells.nx, scene.cells.ny, scene.cells.nz);
    Side side = Side::unknown;
    bool on = true;
    auto const distance_here = [&]() __attribute__((always_inline)) {
        return scene.skip && on ? static_cast<int>(scene.cells.distance[scene.cells.index(outer.cell)]) : 0;
    };
    // On to the next macrocell that may hold a crossing, and then through it: so rays that are drawn together, on a
    // GPU, look into cells together.
    do {
        for (int distance = distance_here(); goes_on(distance > 0); distance = distance_here()) {
            // All cells within that distance lie on one side, as they share faces.
            double const lowest = scene.cells.lowest[scene.cells.index(outer.cell)];
            Side const here = lowest >= iso ? Side::above : Side::below;
            bool const changes = side != Side::unknown && side != here;
            side = here;
            on = (!changes || hit(crossed_at(outer.t), here)) && outer.leap(distance);
        }
        if (!on) continue;
        on = each_piece_of(
            sampler, scene, outer, ray, [&](auto const& piece) __attribute__((always_inline)) {
                counters.samples += 1;
                if (piece.missing) {
                    side = Side::unknown;
                    return true;
                }
                bool const above = static_cast<double>(piece.least) >= iso;
                if (above || static_cast<double>(piece.greatest) < iso) {
                    Side const here = above ? Side::above : Side::below;
                    bool const changes = side != Side::unknown && side != here;
                    side = here;
                    return !changes || hit(crossed_at(piece.t), here);
                }
                return cross_cell(piece.difference(iso), 0.0, piece.t, piece.width, side, hit);
            });
        on = on && outer.advance();
    } while (goes_on(on));
}

/// The same in ascending order: hit(t, side behind).
template <ScalarField S, class Hit>
VKT_HD void cross_ray(S const& sampler, SceneView const& scene, Ray const& ray, double iso, Counters& counters,
                      Hit&& hit) {
    double last = 0; // rounding must not turn the order around
    cross_cells(
        sampler, scene, ray, iso, counters, [&](Crossed const& crossed, Side behind) __attribute__((always_inline)) {
            double const t = crossed.place();
            last = t > last ? t : last;
            return hit(last, behind);
        });
}

/// The part of a line from a point of the lattice, along a direction of unit length, that is shown; false if none is.
VKT_HD bool ray_within(SceneView const& scene, Double3 point, Double3 direction, double reach, Ray& ray) {
    ray.direction = direction;
    double near = 0, far = reach;
    if (!clip(point, ray.direction, scene.shown, near, far)) return false;
    ray.entry = point + ray.direction * near;
    ray.length = far - near;
    return true;
}

/// Share of the light from a direction (of unit length in the lattice) that reaches a point through the surfaces within
/// a length.
template <ScalarField S>
VKT_HD float light_at(S const& sampler, SceneView const& scene, Double3 point, Double3 direction, double reach,
                      Counters& counters) {
    Ray ray{};
    if (!ray_within(scene, point, direction, reach, ray)) return 1;
    float light = 1;
    for (int i = 0; i < scene.iso_count && light > 0; ++i) {
        float const passes = 1.0F - scene.isos[i].alpha;
        if (!(passes < 1)) continue;
        cross_ray(
            sampler, scene, ray, scene.isos[i].value, counters, [&](double, Side) __attribute__((always_inline)) {
                light *= passes;
                return light > 0;
            });
    }
    return light;
}

/// What arrives at a surface element with this gradient, `facing` its part along the ray: of the lamp's light, if that
/// is asked for, and of the light from everywhere. Of the latter all directions on the eye's side count, by the cosine
/// of their angle to the normal. `light_from` tells the share that reaches a point from a direction, within a length.
template <class LightFrom>
VKT_HD Arriving arriving_at(SceneView const& scene, Double3 point, Float3 g, float facing, bool lamp,
                            LightFrom&& light_from) {
    Arriving light;
    float open = 0, all = 0;
    for (int i = lamp ? 0 : 1; i <= scene.around_count; ++i) {
        LightWay const& way = scene.ways[i];
        float const along = dot(g, way.direction) / way.world, cosine = facing > 0 ? -along : along;
        if (i > 0 && !(cosine > 0)) continue;
        Double3 const to_lamp = scene.lamp.lattice * (1 / std::sqrt(dot(scene.lamp.lattice, scene.lamp.lattice)));
        Double3 const direction = i == 0 ? to_lamp : Double3{way.direction.x, way.direction.y, way.direction.z};
        float const share = light_from(point, direction, static_cast<double>(way.reach));
        if (i == 0) {
            light.lamp = share;
            continue;
        }
        all += cosine;
        open += cosine * share;
    }
    if (all > 0) light.ambient = open / all;
    return light;
}

/// A surface element with this gradient as a light at the eye, or the lamp, shows it.
template <class LightFrom>
VKT_HD Radiance lit_element(SceneView const& scene, Ray const& ray, double t, Float3 g, IsoView const& iso,
                            LightFrom&& light_from) {
    // A surface is a surface, however faint the gradient: only its direction matters.
    float const x = std::abs(g.x), y = std::abs(g.y), z = std::abs(g.z), xy = x > y ? x : y;
    float const most = xy > z ? xy : z;
    if (most > 0) g = g * (1.0F / most);
    LampParts<float> const parts =
        scene.lamp.on ? lamp_frame(scene, ray.direction, ray.world_per_lattice).of(g.x, g.y, g.z) : LampParts<float>{};
    bool const asked = scene.lamp.shadows && parts.ray * parts.lamp < 0;
    float const facing = dot(g, to_float(ray.direction));
    Arriving light;
    if (asked || scene.around_count > 0) {
        constexpr double off = 0.02; // lattice units before the surface, so that it does not shade itself
        Double3 const point = ray.entry + ray.direction * (t - off);
        light = arriving_at(scene, point, g, facing, asked, light_from);
    }
    float around[3] = {0, 0, 0};
    if (scene.around.on) {
        float const squared = squared_length(scene.shade, g), open = scene.shade.ambient * light.ambient;
        arriving_from(scene.around, g, squared, surface_share(scene.shade, squared, 0.0F), facing > 0, around);
        for (float& c : around) c *= open;
        light.ambient = 0;
    }
    // What is no surface is lit by the lamp in any case.
    float const base = unshaded(scene.shade, {1, light.ambient});
    float const along = facing * (scene.shade.spacing / static_cast<float>(ray.world_per_lattice));
    Reflection const s = scene.lamp.on ? lamplight(scene.shade, g.x, g.y, g.z, parts, light, base, 0.0F)
                                       : headlight(scene.shade, g.x, g.y, g.z, along, light.ambient, base, 0.0F);
    return {iso.red * (s.diffuse + around[0]) + s.glint, iso.green * (s.diffuse + around[1]) + s.glint,
            iso.blue * (s.diffuse + around[2]) + s.glint, 0};
}

/// The same of an iso-surface.
template <ScalarField S, class LightFrom>
VKT_HD Radiance lit_surface(S const& sampler, SceneView const& scene, Ray const& ray, double t, IsoView const& iso,
                            LightFrom&& light_from) {
    Float3 const g = sampler.gradient(S::place(ray.entry + ray.direction * t));
    return lit_element(scene, ray, t, g, iso, light_from);
}

/// Crossings of a ray with surfaces that light passes, nearest first.
struct Layers {
    static constexpr int most = 32; ///< further ones are not seen
    double t[most];
    int surface[most];
    int count = 0;

    VKT_HD bool full() const { return count == most; }
    VKT_HD void add(double at, int which) {
        if (full() && !(at < t[most - 1])) return;
        int i = full() ? most - 1 : count++;
        for (; i > 0 && at < t[i - 1]; --i) t[i] = t[i - 1], surface[i] = surface[i - 1];
        t[i] = at, surface[i] = which;
    }
};

/// Surfaces of which some let light pass, from the nearest one on.
template <ScalarField S, class LightFrom>
VKT_HD Radiance layers_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters,
                           LightFrom&& light_from) {
    Layers layers;
    double furthest = ray.length; // where a surface that lets nothing pass lies, or so many that none is seen behind
    for (int i = 0; i < scene.iso_count; ++i) {
        if (!(scene.isos[i].alpha > 0)) continue;
        bool const opaque = scene.isos[i].alpha >= 1;
        Ray shorter = ray;
        shorter.length = furthest;
        cross_ray(
            sampler, scene, shorter, scene.isos[i].value, counters, [&](double t, Side) __attribute__((always_inline)) {
                layers.add(t, i);
                if (opaque) furthest = t < furthest ? t : furthest;
                if (layers.full()) furthest = layers.t[Layers::most - 1];
                return !opaque && t < furthest;
            });
    }
    Radiance sum{0, 0, 0, 1};
    for (int k = 0; k < layers.count; ++k) {
        IsoView const& iso = scene.isos[layers.surface[k]];
        Radiance const one = lit_surface(sampler, scene, ray, layers.t[k], iso, light_from);
        float const share = sum.transmittance * iso.alpha;
        sum.red += share * one.red, sum.green += share * one.green, sum.blue += share * one.blue;
        sum.transmittance *= 1.0F - iso.alpha;
        if (!(sum.transmittance > 0)) break;
    }
    return sum;
}

/// The nearest crossing of a ray with surfaces that can be seen; surface -1: none.
struct Nearest {
    double t;
    int surface;
};
template <ScalarField S>
VKT_HD Nearest nearest_surface(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    Nearest nearest{ray.length, -1};
    for (int i = 0; i < scene.iso_count; ++i) {
        if (!(scene.isos[i].alpha > 0)) continue;
        // A nearer surface found before shortens the ray for the ones that follow.
        Ray shorter = ray;
        shorter.length = nearest.t;
        // It is worked out when the walk is over: rays that are drawn together do that together.
        Crossed first = crossed_at(0);
        bool met = false;
        cross_cells(
            sampler, scene, shorter, scene.isos[i].value,
            counters, [&](Crossed const& crossed, Side) __attribute__((always_inline)) {
                first = crossed;
                met = true;
                return false;
            });
        if (!met) continue;
        double const place = first.place(), t = place > 0 ? place : 0;
        if (nearest.surface < 0 || t < nearest.t) nearest = {t, i};
    }
    return nearest;
}

template <ScalarField S, class LightFrom>
VKT_HD Radiance nearest_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters,
                            LightFrom&& light_from) {
    Nearest const hit = nearest_surface(sampler, scene, ray, counters);
    if (hit.surface < 0) return {0, 0, 0, 1};
    return lit_surface(sampler, scene, ray, hit.t, scene.isos[hit.surface], light_from);
}

/// Whether some surface lets light pass.
VKT_HD bool has_layers(SceneView const& scene) {
    for (int i = 0; i < scene.iso_count; ++i)
        if (scene.isos[i].alpha < 1) return true;
    return false;
}

/// The nearest surface of all iso-values, or the layers of them, shaded by a light at the eye.
template <ScalarField S>
VKT_HD Radiance iso_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ++counters.rays;
    auto const light = [&](Double3 point, Double3 direction, double reach) __attribute__((always_inline)) {
        return light_at(sampler, scene, point, direction, reach, counters);
    };
    return has_layers(scene) ? layers_ray(sampler, scene, ray, counters, light)
                             : nearest_ray(sampler, scene, ray, counters, light);
}

/// The same where nothing holds the lamp's light back, nor that from everywhere.
template <bool layers, ScalarField S>
VKT_HD Radiance open_iso_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ++counters.rays;
    auto const light = [](Double3, Double3, double) __attribute__((always_inline)) { return 1.0F; };
    if constexpr (layers)
        return layers_ray(sampler, scene, ray, counters, light);
    else
        return nearest_ray(sampler, scene, ray, counters, light);
}

} // namespace vkt::render
