// Tiles of the image, compiled once per instruction set into a namespace of its own.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tiles.h"

#include "libvkt/render/inner/exact.h"
#include "libvkt/render/inner/iso.h"
#include "libvkt/render/inner/place.h"
#include "libvkt/render/inner/project.h"
#include "libvkt/render/inner/scatter.h"
#include "libvkt/render/kernels/pixels.h"

namespace vkt::render::VKT_BACKEND {

namespace {

template <class T> LatticeSampler<T> sampler_of(LatticeView const& lattice) {
    return {static_cast<T const*>(lattice.data), lattice.row, lattice.slice, lattice.compact};
}

template <class T>
void run(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Tile tile, float* pixels,
         std::int64_t width, Counters& total) {
    LatticeSampler<T> const sampler = sampler_of<T>(lattice);
    Counters counters; // stays in registers
    auto const along_ray = [&](auto&& integrate) { for_rays(scene, tile, pixels, width, integrate); };
    switch (integrator) {
    case Integrator::march:
        along_ray([&](Ray const& ray) { return march_ray(sampler, scene, ray, counters); });
        break;
    case Integrator::exact:
        along_ray([&](Ray const& ray) { return exact_ray(sampler, scene, ray, counters); });
        break;
    case Integrator::iso:
        along_ray([&](Ray const& ray) { return iso_ray(sampler, scene, ray, counters); });
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
            float const at = half_distance(sampler, scene, ray, counters);
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

void render_tile(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Tile tile, float* pixels,
                 std::int64_t width, Counters& counters) {
    switch (lattice.type) {
    case LatticeType::uint8:
        run<std::uint8_t>(scene, lattice, integrator, tile, pixels, width, counters);
        break;
    case LatticeType::uint16:
        run<std::uint16_t>(scene, lattice, integrator, tile, pixels, width, counters);
        break;
    case LatticeType::int16:
        run<std::int16_t>(scene, lattice, integrator, tile, pixels, width, counters);
        break;
    case LatticeType::float32:
        run<float>(scene, lattice, integrator, tile, pixels, width, counters);
        break;
    }
}

} // namespace

TileFunction tile_function() { return render_tile; }

} // namespace vkt::render::VKT_BACKEND
