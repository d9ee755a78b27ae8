// Volumetric path tracing: delta tracking through macrocell majorants, light from all around, the same or that of an
// environment, and from one direction, scattered in all directions alike or as Henyey and Greenstein have it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/march.h"
#include "libvkt/render/inner/random.h"

namespace vkt::render {

/// Extinction per world length and colour at a point, from the same table as the marcher.
struct Medium {
    float extinction, red, green, blue;
};
template <ScalarField S> VKT_HD Medium medium_at(S const& sampler, SceneView const& scene, typename S::Vector p) {
    float const value = sampler.value(p);
    if (!(value == value)) return {0, 0, 0, 0};
    Quad const q = classify(scene.table, table_position(scene.table, value)).density;
    float const per = q[0] > 0 ? 1.0F / q[0] : 0.0F;
    return {q[0], q[1] * per, q[2] * per, q[3] * per};
}

template <class Real> struct Flight {
    bool collided;
    Real t;
    Medium medium;
};

/// Calls at(t, medium, majorant) at tentative collisions, which come at the majorant's rate, until one returns false.
/// Their distances are exponential, which is memoryless, so that what is left of one goes on into the next cell.
template <ScalarField S, class F, class Real = typename S::Real>
VKT_HD void for_each_tentative_collision(S const& sampler, SceneView const& scene, typename S::Vector origin,
                                         typename S::Vector direction, Real length, Real world, Random& random,
                                         Counters& counters, F const& at) {
    CellWalk<Real> cells;
    cells.start(origin - sampler.cell_origin(), direction, length, Real(0), sampler.cell_size(), scene.cells.nx,
                scene.cells.ny, scene.cells.nz);
    float left = -std::log(1.0F - random.next());
    // On to the next cell in which something may be, and then through it: so paths that are traced together, on a GPU,
    // look values up together.
    do {
        Real majorant = 0;
        for (;;) {
            std::int64_t const index = scene.cells.index(cells.cell);
            majorant = scene.cells.majorant[index] * world;
            if (majorant > 0) break;
            if (!cells.leap(scene.cells.distance[index])) return;
        }
        Real t = cells.t;
        Real const leave = cells.leave();
        while (left < majorant * (leave - t)) {
            t += left / majorant;
            Medium const m = medium_at(sampler, scene, origin + direction * t);
            ++counters.samples;
            if (!at(t, m, majorant)) return;
            left = -std::log(1.0F - random.next());
        }
        left -= static_cast<float>(majorant * (leave - t));
    } while (cells.advance());
}

/// Free flight by delta tracking (Woodcock et al. 1965): tentative collisions are accepted with the true share.
template <ScalarField S, class Real = typename S::Real>
VKT_HD Flight<Real> fly(S const& sampler, SceneView const& scene, typename S::Vector origin,
                        typename S::Vector direction, Real length, Real world, Random& random, Counters& counters) {
    Flight<Real> flight{false, length, {}};
    for_each_tentative_collision(sampler, scene, origin, direction, length, world, random, counters,
                                 [&](Real t, Medium const& m, Real majorant) {
                                     if (!(random.next() * majorant < m.extinction * world)) return true;
                                     flight = {true, t, m};
                                     return false;
                                 });
    return flight;
}

/// Share of a light that passes a way, without bias: at tentative collisions the share of the majorant that the
/// extinction leaves passes (ratio tracking: Novák and others, Residual ratio tracking for estimating attenuation in
/// participating media, 2014). Where little is left a roulette ends the way.
template <ScalarField S, class Real = typename S::Real>
VKT_HD float passed(S const& sampler, SceneView const& scene, typename S::Vector origin, typename S::Vector direction,
                    Real length, Real world, Random& random, Counters& counters) {
    constexpr float little = 0.1F;
    float share = 1;
    for_each_tentative_collision(sampler, scene, origin, direction, length, world, random, counters,
                                 [&](Real, Medium const& m, Real majorant) {
                                     float const kept = 1.0F - static_cast<float>(m.extinction * world / majorant);
                                     share *= kept > 0 ? kept : 0.0F;
                                     if (share >= little) return true;
                                     bool const on = random.next() * little < share;
                                     share = on ? little : 0;
                                     return on;
                                 });
    return share;
}

/// Cosine between the directions before and after, for a uniform number in [0, 1): its mean is g, in (-1, 1) (Henyey
/// and Greenstein, Diffuse radiation in the galaxy, 1941). The inverse of the distribution, multiplied out so that
/// nothing cancels at small g.
VKT_HD float henyey_greenstein_cosine(float g, float uniform) {
    float const t = 2.0F * uniform - 1.0F, per = 1.0F / (1.0F + g * t);
    float const cosine = (t + g * (0.5F * (t * t + 3.0F) + g * (t + 0.5F * g * (t * t - 1.0F)))) * per * per;
    return cosine < -1.0F ? -1.0F : cosine > 1.0F ? 1.0F : cosine;
}

/// How likely that cosine is, per steradian.
VKT_HD float henyey_greenstein_density(float g, float cosine) {
    constexpr float per_sphere = 0.0795774715459F;
    // As a sum of what is not negative, so that nothing cancels where it is narrow.
    float const narrow = g < 0 ? -g : g, off = 1.0F - (g < 0 ? -cosine : cosine);
    float const squared = (1.0F - narrow) * (1.0F - narrow) + 2.0F * narrow * (off > 0 ? off : 0.0F);
    return per_sphere * (1.0F - g * g) / (squared * std::sqrt(squared));
}

/// A direction of unit length at this cosine from another, which has any length, and this angle around it.
VKT_HD Double3 direction_around(Double3 axis, float cosine, float angle) {
    Double3 const w = axis * (1 / std::sqrt(dot(axis, axis)));
    // Duff and others, Building an Orthonormal Basis, Revisited, 2017.
    double const sign = std::copysign(1.0, w.z), a = -1 / (sign + w.z), b = w.x * w.y * a;
    Double3 const u{1 + sign * w.x * w.x * a, sign * b, -sign * w.x}, v{b, sign + w.y * w.y * a, -w.y};
    double const z = cosine, r = std::sqrt(1 - z * z > 0 ? 1 - z * z : 0.0), at = angle;
    return u * (r * std::cos(at)) + v * (r * std::sin(at)) + w * z;
}

/// A direction of the world as a ray from a point of the lattice has it.
template <class S> struct Way {
    typename S::Vector direction;
    typename S::Real length, world; ///< lattice units to where the ray leaves what is shown; world length of one
};
template <ScalarField S> VKT_HD Way<S> way_from(SceneView const& scene, typename S::Vector p, Double3 world_way) {
    using Real = typename S::Real;
    Double3 const lattice = scene.to_lattice * world_way;
    double const norm = std::sqrt(dot(lattice, lattice));
    typename S::Vector const d = S::place(lattice * (1 / norm));
    double near = 0, far = std::numeric_limits<double>::infinity();
    Double3 const from{p.x, p.y, p.z}, along{d.x, d.y, d.z};
    // A collision that rounding put onto the border may have nothing ahead of it: then the path leaves right here.
    bool const inside = clip(from, along, scene.shown, near, far);
    return {d, inside ? static_cast<Real>(far) : Real(0), static_cast<Real>(1 / norm)};
}

/// The part of the environment's light that is scattered at a point into the direction in which a path came, with a
/// direction drawn by brightness. It and the direction that the path takes on are weighted by how likely either way was
/// to find it (Veach and Guibas, Optimally Combining Sampling Techniques, 1995, the balance heuristic).
template <ScalarField S>
VKT_HD void add_environment(S const& sampler, SceneView const& scene, typename S::Vector p, Double3 world_way,
                            float const* through, float* sum, Random& random, Counters& counters) {
    float const row = random.next(), column = random.next(), across = random.next(), down = random.next();
    SampledLight const light = sampled_light(scene.environment, row, column, across, down);
    Way<S> const way = way_from<S>(scene, p, light.direction);
    // Nothing on the way: the share of such flights is the share of the light that arrives.
    if (fly(sampler, scene, p, way.direction, way.length, way.world, random, counters).collided) return;
    float const density =
        henyey_greenstein_density(scene.anisotropy, static_cast<float>(dot(world_way, light.direction)));
    float const weight = density / (density + likelihood_of(scene.environment, light.pixel));
    for (int i = 0; i < 3; ++i) sum[i] += through[i] * scene.light[i] * light.pixel[i] * weight;
}

/// The same of a light that is far away, in one direction, which no path meets by itself.
template <ScalarField S>
VKT_HD void add_lamp(S const& sampler, SceneView const& scene, typename S::Vector p, Double3 world_way,
                     float const* through, float* sum, Random& random, Counters& counters) {
    Way<S> const way = way_from<S>(scene, p, scene.lamp.world);
    float const cosine = static_cast<float>(dot(world_way, scene.lamp.world));
    float const share = passed(sampler, scene, p, way.direction, way.length, way.world, random, counters) *
                        henyey_greenstein_density(scene.anisotropy, cosine);
    for (int i = 0; i < 3; ++i) sum[i] += through[i] * scene.lamp.light[i] * share;
}

/// One path. Returns premultiplied radiance; transmittance 1 means that the camera ray met nothing.
template <ScalarField S>
VKT_HD Radiance scatter_path(S const& sampler, SceneView const& scene, Ray const& ray, Random& random,
                             Counters& counters) {
    constexpr int roulette_from = 8;
    constexpr float two_pi = 6.28318530718F;
    float through[3] = {1, 1, 1}, sum[3] = {0, 0, 0};
    using Real = typename S::Real;
    typename S::Vector p = S::place(ray.entry), d = S::place(ray.direction);
    auto length = static_cast<Real>(ray.length), world = static_cast<Real>(ray.world_per_lattice);
    bool const pictured = scene.environment.pixels != nullptr;
    Double3 world_way = ray.direction; // of unit length, after the first scattering
    float density = 0;                 // how likely the path was to take it
    for (int bounce = 0;; ++bounce) {
        Flight<Real> const flight = fly(sampler, scene, p, d, length, world, random, counters);
        if (!flight.collided) {
            if (bounce == 0) return {0, 0, 0, 1};
            if (!pictured) {
                for (int i = 0; i < 3; ++i) sum[i] += through[i] * scene.light[i];
                break;
            }
            float const* const pixel = light_from(scene.environment, world_way);
            float const weight = density / (density + likelihood_of(scene.environment, pixel));
            for (int i = 0; i < 3; ++i) sum[i] += through[i] * scene.light[i] * pixel[i] * weight;
            break;
        }
        Medium const& m = flight.medium;
        float const colour[3] = {m.red, m.green, m.blue};
        for (int i = 0; i < 3; ++i) {
            if (scene.emission) sum[i] += through[i] * colour[i];
            through[i] *= scene.albedo * colour[i];
        }
        float const rg = through[0] > through[1] ? through[0] : through[1];
        float const most = rg > through[2] ? rg : through[2];
        if (!(most > 0)) break;
        if (bounce + 1 >= scene.bounces) {
            ++counters.capped;
            break;
        }
        p = p + d * flight.t;
        bool const drawn = pictured && scene.environment.per_total > 0;
        if (drawn || scene.lamp.on) {
            Double3 const whole = scene.to_world * Double3{d.x, d.y, d.z},
                          came = whole * (1 / std::sqrt(dot(whole, whole)));
            if (drawn) add_environment(sampler, scene, p, came, through, sum, random, counters);
            if (scene.lamp.on) add_lamp(sampler, scene, p, came, through, sum, random, counters);
        }
        if (bounce >= roulette_from && most < 1) {
            if (random.next() >= most) break;
            for (float& w : through) w /= most;
        }
        float const place = random.next(), angle = two_pi * random.next();
        float cosine = 0;
        if (scene.anisotropy == 0) {
            float const z = 1.0F - 2.0F * place, r = std::sqrt(1.0F - z * z > 0 ? 1.0F - z * z : 0.0F);
            world_way = {r * std::cos(angle), r * std::sin(angle), z};
        } else {
            cosine = henyey_greenstein_cosine(scene.anisotropy, place);
            world_way = direction_around(scene.to_world * Double3{d.x, d.y, d.z}, cosine, angle);
        }
        if (pictured) density = henyey_greenstein_density(scene.anisotropy, cosine);
        Way<S> const way = way_from<S>(scene, p, world_way);
        d = way.direction, length = way.length, world = way.world;
    }
    return {sum[0], sum[1], sum[2], 0};
}

/// Mean of the paths of one pixel, those of earlier passes included; each has its own place in the pixel.
template <ScalarField S>
VKT_HD Radiance scatter_pixel(S const& sampler, SceneView const& scene, int x, int y, Counters& counters) {
    PixelSums sums(scene, x, y);
    auto const pixel = static_cast<std::uint32_t>(
        (std::int64_t{y} + scene.frame.top) * static_cast<std::int64_t>(scene.frame.width) + x);
    bool met = false;
    for (int i = 0; i < scene.samples; ++i) {
        Random random(scene.seed, pixel, static_cast<std::uint32_t>(scene.first_sample + i));
        float const dx = random.next(), dy = random.next();
        Ray ray;
        if (!make_ray(scene.frame, x + static_cast<double>(dx), y + static_cast<double>(dy), scene.shown, ray)) {
            sums.add({0, 0, 0, 1});
            continue;
        }
        met = true;
        ++counters.segments;
        sums.add(scatter_path(sampler, scene, ray, random, counters));
    }
    counters.rays += met;
    return sums.finish();
}

} // namespace vkt::render
