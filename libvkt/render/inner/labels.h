// Volumes of labels: a ray walks from voxel to voxel and ends in the first that is no background. No value is ever
// interpolated; only the light on the surface is smooth.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/iso.h"

namespace vkt::render {

/// What can be asked for single voxels.
template <class S>
concept VoxelField = ScalarField<S> && requires(S const& s) {
    { s.voxel(0, 0, 0) } -> std::same_as<float>;
};

/// Where a ray meets a label: the distance along it, the voxel, and the axis across whose face it came in; -1: it began
/// in there.
struct LabelHit {
    double t = 0;
    int voxel[3] = {0, 0, 0};
    float value = 0;
    int axis = -1;
};

/// Whether a voxel is something; what has no data is nothing.
VKT_HD bool is_label(SceneView const& scene, float value) { return value < scene.nothing || value > scene.nothing; }

/// The first voxel along a ray that is something. Voxel i of an axis fills [i - 1/2, i + 1/2); voxels in macrocells
/// without any are passed over.
template <VoxelField S>
VKT_HD bool meet_label(S const& sampler, SceneView const& scene, Ray const& ray, LabelHit& hit, Counters& counters) {
    CellWalk<double> walk;
    constexpr double first = -0.5;
    walk.start(ray.entry, ray.direction, ray.length, first, 1.0, scene.voxels[0], scene.voxels[1], scene.voxels[2]);
    int const counts[3] = {scene.cells.nx, scene.cells.ny, scene.cells.nz};
    int leap = 1;
    do {
        leap = 1;
        if (scene.skip) {
            int cell[3];
            for (int axis = 0; axis < 3; ++axis) {
                int const at = (walk.cell[axis] - (lattice_padding - 1)) / macrocell_size; // the padding is the first's
                cell[axis] = at < counts[axis] ? at : counts[axis] - 1;
            }
            int const distance = scene.cells.distance[scene.cells.index(cell)];
            if (distance > 0) {
                leap = macrocell_size * (distance - 1) + 1;
                continue;
            }
        }
        ++counters.samples;
        float const value = sampler.voxel(walk.cell[0], walk.cell[1], walk.cell[2]);
        if (!is_label(scene, value)) continue;
        // By its voxel alone, whatever way led there.
        double const entry[3] = {ray.entry.x, ray.entry.y, ray.entry.z},
                     way[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
        for (int axis = 0; axis < 3; ++axis) {
            hit.voxel[axis] = walk.cell[axis];
            if (way[axis] == 0) continue;
            double const face = walk.cell[axis] + (way[axis] > 0 ? first : -first);
            double const t = (face - entry[axis]) / way[axis];
            if (t > hit.t) hit.t = t, hit.axis = axis;
        }
        hit.value = value;
        return true;
    } while (walk.leap(leap));
    return false;
}

/// Derivative, at a point of the lattice, of what is something (1) and nothing (0), smoothed by quadratic B-splines
/// twice as wide as voxels, whose standard deviation is one voxel. On faces of straight walls it has no part along
/// them.
template <VoxelField S> VKT_HD Float3 label_gradient(S const& sampler, SceneView const& scene, Double3 point) {
    constexpr int reach = 6;
    double const place[3] = {point.x, point.y, point.z};
    int at[3][reach];
    float weight[3][reach], slope[3][reach];
    for (int axis = 0; axis < 3; ++axis) {
        int const from = static_cast<int>(std::floor(place[axis])) - 2, last = scene.voxels[axis] - 1;
        for (int i = 0; i < reach; ++i) {
            int const voxel = from + i;
            at[axis][i] = voxel < 0 ? 0 : voxel > last ? last : voxel;
            auto const x = static_cast<float>(0.5 * (place[axis] - voxel));
            float const away = x < 0 ? -x : x, rest = away < 1.5F ? 1.5F - away : 0.0F;
            weight[axis][i] = away < 0.5F ? 0.75F - x * x : 0.5F * rest * rest;
            slope[axis][i] = away < 0.5F ? -2.0F * x : x < 0 ? rest : -rest;
        }
    }
    Float3 sum{0, 0, 0};
    for (int k = 0; k < reach; ++k)
        for (int j = 0; j < reach; ++j) {
            float in = 0, along = 0;
            for (int i = 0; i < reach; ++i) {
                bool const something = is_label(scene, sampler.voxel(at[0][i], at[1][j], at[2][k]));
                in += something ? weight[0][i] : 0.0F;
                along += something ? slope[0][i] : 0.0F;
            }
            sum.x += along * weight[1][j] * weight[2][k];
            sum.y += in * slope[1][j] * weight[2][k];
            sum.z += in * weight[1][j] * slope[2][k];
        }
    return sum;
}

/// The normal of what is shown where a ray enters it, as a derivative in the lattice; zeros where the eye is inside.
VKT_HD Float3 cut_gradient(SceneView const& scene, Ray const& ray) {
    if (!(ray.start > 0)) return {0, 0, 0};
    double const entry[3] = {ray.entry.x, ray.entry.y, ray.entry.z};
    double const lower[3] = {scene.shown.lower.x, scene.shown.lower.y, scene.shown.lower.z},
                 upper[3] = {scene.shown.upper.x, scene.shown.upper.y, scene.shown.upper.z};
    double nearest = std::numeric_limits<double>::infinity();
    Float3 normal{0, 0, 0};
    auto const look = [&](double away, Float3 across) {
        double const distance = away < 0 ? -away : away;
        if (distance < nearest) nearest = distance, normal = across;
    };
    for (int axis = 0; axis < 3; ++axis) {
        Float3 const across{axis == 0 ? 1.0F : 0.0F, axis == 1 ? 1.0F : 0.0F, axis == 2 ? 1.0F : 0.0F};
        look(entry[axis] - lower[axis], across);
        look(entry[axis] - upper[axis], across);
    }
    for (int i = 0; i < scene.shown.plane_count; ++i) {
        HalfSpace const& half = scene.shown.planes[i];
        double const length = std::sqrt(dot(half.normal, half.normal));
        look((dot(half.normal, ray.entry) - half.offset) / length, to_float(half.normal * (1 / length)));
    }
    return normal;
}

/// The surface that a ray meets: its normal as a derivative in the lattice.
template <VoxelField S>
VKT_HD Float3 label_normal(S const& sampler, SceneView const& scene, Ray const& ray, LabelHit const& hit) {
    if (hit.axis < 0) return cut_gradient(scene, ray);
    Float3 const smooth = label_gradient(sampler, scene, ray.entry + ray.direction * hit.t);
    float const length = std::sqrt(dot(smooth, smooth));
    constexpr float least = 1e-4F; // thin walls have as much before them as behind them
    if (length > least) {
        // What is seen faces the eye: where the smoothed surface does not, as it may beside an edge, it is seen from
        // its edge.
        Float3 const way = to_float(ray.direction);
        float const along = dot(smooth, way), grazing = 1e-3F * length;
        return along > grazing ? smooth : smooth + way * (grazing - along);
    }
    return {hit.axis == 0 ? 1.0F : 0.0F, hit.axis == 1 ? 1.0F : 0.0F, hit.axis == 2 ? 1.0F : 0.0F};
}

/// How a label is shown.
VKT_HD IsoView const& shown_as(SceneView const& scene, float value) {
    int low = 0, high = scene.label_count - 1;
    while (low < high) {
        int const middle = (low + high) / 2;
        if (scene.labels[middle].value < value)
            low = middle + 1;
        else
            high = middle;
    }
    return scene.labels[low];
}

/// The nearest label of a ray, lit as iso-surfaces are.
template <VoxelField S>
VKT_HD Radiance label_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ++counters.rays;
    LabelHit hit;
    if (!meet_label(sampler, scene, ray, hit, counters)) return {0, 0, 0, 1};
    Float3 const g = label_normal(sampler, scene, ray, hit);
    // A voxel before the surface, so that its steps throw no shadows on one another.
    double const length = std::sqrt(static_cast<double>(dot(g, g)));
    Double3 lift{0, 0, 0};
    if (length > 0 && hit.axis >= 0)
        lift = Double3{g.x, g.y, g.z} * ((dot(g, to_float(ray.direction)) > 0 ? -1 : 1) / length);
    auto const light = [&](Double3 point, Double3 direction, double reach) __attribute__((always_inline)) {
        Ray to_light{};
        if (!ray_within(scene, point + lift, direction, reach, to_light)) return 1.0F;
        LabelHit other;
        return meet_label(sampler, scene, to_light, other, counters) ? 0.0F : 1.0F;
    };
    return lit_element(scene, ray, hit.t, g, shown_as(scene, hit.value), light);
}

} // namespace vkt::render
