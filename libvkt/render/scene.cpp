// The camera, the light and the part that is shown, in the lattice.
// SPDX-License-Identifier: MIT
#include "libvkt/core/products.h"
#include "libvkt/render/categories.h"
#include "libvkt/render/render.h"
#include "libvkt/render/world.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt::render {

namespace {

/// A plane of the world, as RenderSettings::clip_planes has it, in the lattice in which the first cell's centre is at
/// (first, first, first).
HalfSpace half_space(double const* plane, Geometry const& g, double first) {
    // Whatever the size of the world: only the direction of the normal matters, once the distance is in its units.
    double const length = std::hypot(plane[0], plane[1], plane[2]);
    Double3 const normal{plane[0] / length, plane[1] / length, plane[2] / length};
    Matrix3 const to_world = lattice_to_world(g);
    Double3 const mapped{dot(to_world.x, normal), dot(to_world.y, normal), dot(to_world.z, normal)};
    double const origin = dot(normal, Double3{g.origin.x, g.origin.y, g.origin.z});
    return {mapped, plane[3] / length - origin + first * (mapped.x + mapped.y + mapped.z)};
}

/// A direction of the world, of unit length, with a reach in the world.
LightWay light_way(SceneView const& scene, Double3 world, double reach) {
    Double3 const lattice = scene.to_lattice * world;
    double const length = std::sqrt(dot(lattice, lattice));
    return {to_float(lattice * (1 / length)), static_cast<float>(1 / length), static_cast<float>(reach * length)};
}

/// Diffuse light of an environment, multiplied by so much. Of the cosine of the angle between a normal and the light,
/// cut off at 0, the orders that are left out are small parts: it is 3/32 + c/2 + 15/32 c^2. The normal is that of a
/// lattice gradient, whose parts along the lattice's axes are `rows`.
IrradianceView irradiance_of(Environment const& environment, double degrees, float const* light,
                             Double3 const (&rows)[3]) {
    IrradianceView view;
    view.on = true;
    for (std::size_t c = 0; c < 3; ++c) {
        auto const [all, x, y, z, xx, yy, zz, xy, xz, yz] = environment.moments_of(c, degrees);
        Double3 const ways{x, y, z};
        double const strength = static_cast<double>(light[c]) / half_turn;
        view.mean[c] = static_cast<float>(strength * all / 4);
        view.constant[c] = static_cast<float>(strength * all * 3 / 32);
        Matrix3 const squares{{xx, xy, xz}, {xy, yy, yz}, {xz, yz, zz}};
        auto const along = [&](int i) { return static_cast<float>(strength / 2 * dot(rows[i], ways)); };
        auto const part = [&](int i, int j, double factor) {
            return static_cast<float>(factor * strength * 15 / 32 * dot(rows[i], squares * rows[j]));
        };
        view.linear[c] = {along(0), along(1), along(2)};
        float const quadratic[6] = {part(0, 0, 1), part(1, 1, 1), part(2, 2, 1),
                                    part(0, 1, 2), part(0, 2, 2), part(1, 2, 2)};
        std::copy(std::begin(quadratic), std::end(quadratic), view.quadratic[c]);
    }
    return view;
}

} // namespace

SceneView Renderer::scene_of(RenderSettings const& settings, Appearance const& appearance, Camera const& camera) const {
    SceneView scene{};
    Geometry const& g = header_.geometry;
    double const first = tree_ ? 0.5 : lattice_padding;
    scene.frame = frame_of(camera, g, first, settings.width, settings.height);
    Box shown = region_;
    if (!settings.clip.empty()) shown = intersect(shown, settings.clip.resolve(header_.dims));
    auto const place = [&](Index3 i) {
        double const low = first - 0.5;
        return Double3{low + static_cast<double>(i.x), low + static_cast<double>(i.y), low + static_cast<double>(i.z)};
    };
    scene.shown.lower = place(shown.lower);
    scene.shown.upper = place(shown.upper);
    scene.to_lattice = world_to_lattice(g);
    scene.to_world = lattice_to_world(g);
    for (std::size_t i = 0; i + 4 <= settings.clip_planes.size(); i += 4)
        scene.shown.planes[scene.shown.plane_count++] = half_space(&settings.clip_planes[i], g, first);

    // Gradients are shaded in units of a reference, so that the sizes of values and of the world do not matter. |A^T
    // g|^2 for a lattice gradient g, A mapping world vectors, in smallest spacings, to lattice vectors.
    double const smallest = smallest_spacing(g);
    Matrix3 const& a = scene.to_lattice;
    Double3 const rows[3] = {Double3{a.x.x, a.y.x, a.z.x} * smallest, Double3{a.x.y, a.y.y, a.z.y} * smallest,
                             Double3{a.x.z, a.y.z, a.z.z} * smallest};
    auto const metric = [&](int i, int j, double factor) { return static_cast<float>(factor * dot(rows[i], rows[j])); };
    auto const part_of = [](double share, double from, double to) { return share * to - share * from; };
    double part = part_of(0.02, appearance.domain.lower, appearance.domain.upper);
    // Of a single value all surfaces are shaded, and of a constant volume none.
    if (!(part > 0)) part = part_of(2e-8, histogram().least, histogram().greatest);
    if (!(part > 0)) part = 0.02;
    double const reference =
        part / std::abs(header_.values.slope) * rescaling().scale / (tree_ ? tree_->typical_width() : 1);
    scene.shade = {
        static_cast<float>(appearance.shade),
        static_cast<float>(settings.ambient),
        static_cast<float>(settings.specular),
        static_cast<float>(std::min(1 / reference, 1e30)),
        static_cast<float>(smallest),
        {metric(0, 0, 1), metric(1, 1, 1), metric(2, 2, 1), metric(0, 1, 2), metric(0, 2, 2), metric(1, 2, 2)}};
    if (settings.light_direction) {
        Vec3 const v = *settings.light_direction;
        double const size = length(v);
        Double3 const toward{v.x / size, v.y / size, v.z / size};
        constexpr double anywhere = std::numeric_limits<double>::infinity();
        scene.lamp.on = true, scene.lamp.shadows = settings.shadows;
        scene.lamp.world = toward, scene.lamp.lattice = scene.to_lattice * toward;
        scene.ways[0] = light_way(scene, toward, anywhere);
    }
    double const radius = settings.occlusion_radius > 0 ? settings.occlusion_radius : diagonal(g, region_.dims()) / 10;
    scene.around_count = settings.ambient_occlusion;
    for (int i = 0; i < scene.around_count; ++i) {
        // Evenly spread: rings of the same area, turned by the golden angle from one to the next.
        double const z = 1 - (2 * i + 1.0) / scene.around_count, r = std::sqrt(1 - z * z);
        double const angle = i * 2.3999632297286533;
        scene.ways[1 + i] = light_way(scene, {r * std::cos(angle), r * std::sin(angle), z}, radius);
    }
    scene.iso_count = static_cast<int>(appearance.isos.size());
    std::copy(appearance.isos.begin(), appearance.isos.end(), scene.isos);
    if (appearance.labels) {
        scene.labels = appearance.labels->views.data();
        scene.label_count = static_cast<int>(appearance.labels->views.size());
        scene.nothing = appearance.labels->nothing;
        for (int axis = 0; axis < 3; ++axis)
            scene.voxels[axis] = static_cast<int>(header_.dims[axis]) + 2 * lattice_padding;
    }
    scene.step = static_cast<float>(settings.step);
    scene.skip = settings.skip;
    if (settings.goal.any()) // what rays leave out is to be a small part of the error
        scene.patience = static_cast<float>(std::clamp(settings.goal.tolerance / 2, 1.0 / 64, 1.0));
    scene.samples = settings.samples;
    scene.first_sample = settings.first_sample;
    scene.bounces = settings.bounces;
    scene.seed = settings.seed;
    scene.albedo = static_cast<float>(settings.albedo);
    scene.anisotropy = static_cast<float>(settings.anisotropy);
    scene.emission = settings.emission;
    bool const scatters = settings.algorithm == Algorithm::multi_scattering;
    double const strength = settings.environment ? settings.environment_strength : 1;
    double const colors[3] = {settings.light.red, settings.light.green, settings.light.blue};
    // A light from one direction that is scattered as much as one from everywhere.
    constexpr double per_sphere = 4 * half_turn;
    double const everywhere = scatters && scene.lamp.on ? settings.ambient : 1;
    for (int c = 0; c < 3; ++c) {
        scene.light[c] = static_cast<float>(colors[c] * strength * everywhere);
        scene.lamp.light[c] = static_cast<float>(colors[c] * (1 - everywhere) * per_sphere);
    }
    if (settings.environment && scatters)
        scene.environment = settings.environment->view(settings.environment_rotation);
    else if (settings.environment)
        scene.around = irradiance_of(*settings.environment, settings.environment_rotation, scene.light, rows);
    return scene;
}

} // namespace vkt::render
