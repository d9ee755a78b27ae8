// Light that the volume itself holds back on its way to a point of a marched ray: shadows and ambient occlusion.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/sampler.h"
#include "libvkt/render/inner/scene.h"

namespace vkt::render {

/// Values along a line, at once where the sampler can.
template <int n, ScalarField S>
VKT_HD void values_along(S const& sampler, typename S::Vector origin, typename S::Vector direction,
                         typename S::Real const* t, float* out) {
    if constexpr (Sampler<S>)
        sampler.template values<n>(origin, direction, t, out);
    else
        for (int k = 0; k < n; ++k) out[k] = sampler.value(origin + direction * t[k]);
}

/// Optical depth from a point along a way to a light, where that is below 64; beyond, 64 or more. Macrocells in which
/// nothing can be seen are passed over; in the others segments have the same length, two steps at most. The error falls
/// with the square of the step.
template <ScalarField S>
VKT_HD float depth_along(S const& sampler, SceneView const& scene, typename S::Vector p, LightWay const& way,
                         std::int64_t& samples) {
    using Real = typename S::Real;
    // Nothing is left of the light then, nor of it on a segment that is as deep as most and begins outside.
    constexpr float deepest = 64;
    constexpr int together = chunk < 16 ? chunk : 16; // macrocells are small
    double near = 0, far = static_cast<double>(way.reach);
    Double3 const from{p.x, p.y, p.z}, along{way.direction.x, way.direction.y, way.direction.z};
    if (!clip(from, along, scene.shown, near, far)) return 0;
    typename S::Vector const d = S::place(along);
    Real const per_step = Real(0.5) / static_cast<Real>(scene.step);
    float depth = 0;
    CellWalk<Real> cells;
    cells.start(p - sampler.cell_origin(), d, static_cast<Real>(far), Real(0), sampler.cell_size(), scene.cells.nx,
                scene.cells.ny, scene.cells.nz);
    int distance = 0;
    do {
        distance = scene.cells.distance[scene.cells.index(cells.cell)];
        if (distance > 0) continue;
        Real const begin = cells.t, end = cells.leave();
        if (!(end > begin)) continue;
        int const segments = static_cast<int>((end - begin) * per_step) + 1;
        Real const width = (end - begin) / static_cast<Real>(segments);
        Classified last{};
        float last_position = 0;
        bool last_missing = true;
        for (int first = 0; first <= segments; first += together) {
            alignas(64) Real t[together];
            alignas(64) float value[together];
            for (int k = 0; k < together; ++k) {
                int const point = first + k < segments ? first + k : segments;
                t[k] = begin + static_cast<Real>(point) * width;
            }
            values_along<together>(sampler, p, d, t, value);
            for (int k = 0; k < together && first + k <= segments; ++k) {
                float const position = table_position(scene.table, value[k]);
                Classified const here = classify(scene.table, position);
                bool const missing = !(value[k] == value[k]);
                if (!missing && !last_missing) {
                    float const mean = segment_mean(last, here, position - last_position)[0];
                    if (mean > 0) depth += mean * (static_cast<float>(width) * way.world);
                }
                last = here, last_position = position, last_missing = missing;
            }
        }
        samples += segments + 1;
        if (depth > deepest) break;
    } while (cells.leap(distance));
    return depth;
}

/// Share of a light that reaches what is seen of a segment: the depth towards the light runs from `begin` to `end`,
/// that towards the eye from 0 to `depth`, of which the share `absorbed` is seen. Exact where the medium is the same
/// along the segment, however deep that is.
VKT_HD float arriving_share(float begin, float end, float depth, float absorbed) {
    float const rise = depth + end - begin;
    float const least = rise > 0 ? begin : end + depth, width = rise > 0 ? rise : -rise;
    float const mean = width > 1e-3F ? attenuation(width).absorbed / width : 1.0F - 0.5F * width;
    return attenuation(least).transmitted * mean * (depth / absorbed);
}

/// Shares of the lamp's light and of the light from everywhere.
struct Arriving {
    float lamp = 1, ambient = 1;
};

/// The light along one marched ray: depths along all of its ways at the point that was looked at last.
struct Occlusion {
    float depths[1 + most_ways];
    int known = -1; ///< the point that they belong to

    /// What arrives on the segment from point k, at `begin`, to the next one, at `end`.
    template <ScalarField S>
    VKT_HD Arriving on_segment(S const& sampler, SceneView const& scene, int k, typename S::Vector begin,
                               typename S::Vector end, float depth, float absorbed, std::int64_t& samples) {
        int const first = scene.lamp.shadows ? 0 : 1;
        float before[1 + most_ways];
        for (int point = known == k ? 1 : 0; point < 2; ++point)
            for (int i = first; i <= scene.around_count; ++i) {
                before[i] = depths[i];
                depths[i] = depth_along(sampler, scene, point == 0 ? begin : end, scene.ways[i], samples);
            }
        known = k + 1;
        Arriving arriving;
        if (scene.lamp.shadows) arriving.lamp = arriving_share(before[0], depths[0], depth, absorbed);
        if (scene.around_count == 0) return arriving;
        float sum = 0;
        for (int i = 1; i <= scene.around_count; ++i) sum += arriving_share(before[i], depths[i], depth, absorbed);
        arriving.ambient = sum / static_cast<float>(scene.around_count);
        return arriving;
    }
};

} // namespace vkt::render
