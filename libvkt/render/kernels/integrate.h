// Which integrator draws a tile: the same for every kind of volume.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/place.h"
#include "libvkt/render/inner/project.h"
#include "libvkt/render/inner/scatter.h"
#include "libvkt/render/kernels/pixels.h"

namespace vkt::render::VKT_BACKEND {

// Internal, so that what it instantiates is: the same function for another instruction set must not replace it.
namespace {

template <class S>
VKT_HD void integrate(S const& sampler, SceneView const& scene, Integrator integrator, Tile tile, float* pixels,
                      std::int64_t width, Counters& total) {
    Counters counters; // stays in registers
    auto const along_ray = [&](auto&& one) { for_rays(scene, tile, pixels, width, one); };
    switch (integrator) {
    case Integrator::march:
        along_ray([&](Ray const& ray) { return march_ray(sampler, scene, ray, counters); });
        break;
    case Integrator::exact:
        along_ray([&](Ray const& ray) { return exact_ray(sampler, scene, ray, counters); });
        break;
    case Integrator::iso:
        along_ray([&](Ray const& ray) {
            if constexpr (VoxelField<S>)
                if (scene.label_count > 0) return label_ray(sampler, scene, ray, counters);
            return iso_ray(sampler, scene, ray, counters);
        });
        break;
    case Integrator::project:
        along_ray([&](Ray const& ray) { return project_ray(sampler, scene, ray, counters); });
        break;
    case Integrator::place:
        for_middles(scene, tile, pixels, width, std::numeric_limits<float>::infinity(),
                    [&](Ray const& ray) { return surface_place(sampler, scene, ray, counters); });
        break;
    case Integrator::albedo:
        for_middles(scene, tile, pixels, width, 1,
                    [&](Ray const& ray) { return surface_albedo(sampler, scene, ray, counters); });
        break;
    case Integrator::half_distance:
        for_middles(scene, tile, pixels, width, std::numeric_limits<float>::infinity(), [&](Ray const& ray) {
            float const at = half_distance(sampler, scene, ray);
            return Radiance{at, at, at, at};
        });
        break;
    case Integrator::scatter:
        for_pixels(tile, pixels, width, [&](int x, int y) { return scatter_pixel(sampler, scene, x, y, counters); });
        break;
    }
    total.rays += counters.rays;
    total.segments += counters.segments;
    total.samples += counters.samples;
    total.capped += counters.capped;
}

} // namespace

} // namespace vkt::render::VKT_BACKEND
