// The picture on a GPU: a thread a pixel, with the inner loops of the CPU.
// SPDX-License-Identifier: MIT
#include "libvkt/render/device.h"

#include "libvkt/core/device.h"
#include "libvkt/render/inner/iso.h"
#include "libvkt/render/inner/labels.h"
#include "libvkt/render/kernels/device_pixels.h"

namespace vkt::render {
namespace {

template <Integrator integrator, class T>
__global__ void __launch_bounds__(block_x* block_y)
    pixels_kernel(__grid_constant__ SceneView const scene, LatticeSampler<T> sampler, Bands bands, float* pixels,
                  unsigned long long* totals) {
    Tile const tile = pixel_of_thread(bands);
    Counters counters;
    if (tile.x0 < tile.x1) draw_pixel<integrator>(sampler, scene, tile, pixels, counters);
    add_counters(counters, totals);
}

template <class T>
__global__ void __launch_bounds__(block_x* block_y, 4)
    labels_kernel(__grid_constant__ SceneView const scene, LatticeSampler<T> sampler, Bands bands, float* pixels,
                  unsigned long long* totals) {
    Tile const tile = pixel_of_thread(bands);
    Counters counters;
    if (tile.x0 < tile.x1)
        for_rays(scene, tile, pixels, scene.frame.width,
                 [&](Ray const& ray) { return label_ray(sampler, scene, ray, counters); });
    add_counters(counters, totals);
}

/// Blocks of a multiprocessor, by which registers are given out; measured.
constexpr int blocks_of(Usual usual) { return usual == Usual::flat ? 6 : usual == Usual::shaded ? 5 : 4; }

template <Usual usual, class T>
__global__ void __launch_bounds__(block_x* block_y, blocks_of(usual))
    usual_kernel(__grid_constant__ SceneView const scene, LatticeSampler<T> sampler, Bands bands, float* pixels,
                 unsigned long long* totals) {
    Tile const tile = pixel_of_thread(bands);
    Counters counters;
    if (tile.x0 < tile.x1)
        for_middles(scene, tile, pixels, scene.frame.width, 1, [&](Ray const& ray) {
            if constexpr (usual == Usual::flat) return march_lit<Lighting::flat>(sampler, scene, ray, counters);
            if constexpr (usual == Usual::shaded) return march_lit<Lighting::open>(sampler, scene, ray, counters);
            if constexpr (usual == Usual::surface) return open_iso_ray<false>(sampler, scene, ray, counters);
            if constexpr (usual == Usual::layers) return open_iso_ray<true>(sampler, scene, ray, counters);
        });
    add_counters(counters, totals);
}

template <Integrator integrator, class T>
void launch(SceneView const& scene, LatticeView const& lattice, Bands const& bands, float* pixels,
            unsigned long long* totals) {
    if (bands.count() == 0) return;
    dim3 const grid = blocks_over(bands), block(block_x, block_y);
    LatticeSampler<T> const sampler{static_cast<T const*>(lattice.data), lattice.row, lattice.slice, lattice.compact};
    bool const usual = is_usual(scene);
    if constexpr (integrator == Integrator::march) {
        if (usual && scene.shade.strength > 0)
            usual_kernel<Usual::shaded, T><<<grid, block>>>(scene, sampler, bands, pixels, totals);
        else if (usual)
            usual_kernel<Usual::flat, T><<<grid, block>>>(scene, sampler, bands, pixels, totals);
        if (usual) return check_launch("render");
    }
    if constexpr (integrator == Integrator::iso) {
        if (scene.label_count > 0) {
            labels_kernel<T><<<grid, block>>>(scene, sampler, bands, pixels, totals);
            return check_launch("render");
        }
        if (usual && has_layers(scene))
            usual_kernel<Usual::layers, T><<<grid, block>>>(scene, sampler, bands, pixels, totals);
        else if (usual)
            usual_kernel<Usual::surface, T><<<grid, block>>>(scene, sampler, bands, pixels, totals);
        if (usual) return check_launch("render");
    }
    pixels_kernel<integrator, T><<<grid, block>>>(scene, sampler, bands, pixels, totals);
    check_launch("render");
}

} // namespace

void launch_drawing(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Bands const& bands,
                    float* pixels, std::uint64_t* totals) {
    auto* const counts = reinterpret_cast<unsigned long long*>(totals);
    with_integrator(integrator, [&]<Integrator drawn>(std::integral_constant<Integrator, drawn>) {
        with_lattice_type(lattice.type, [&]<class T>(T) { launch<drawn, T>(scene, lattice, bands, pixels, counts); });
    });
}

} // namespace vkt::render
