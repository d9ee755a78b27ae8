// The picture of a hierarchical volume on a GPU: a thread a pixel, with the inner loops of the CPU, but for lists.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/render/device.h"
#include "libvkt/render/inner/iso.h"
#include "libvkt/render/inner/piece_walk.h"
#include "libvkt/render/inner/segment_march.h"
#include "libvkt/render/kernels/device_pixels.h"

namespace vkt::render {
namespace {

template <class T>
__device__ __forceinline__ TreePoints<T, NoScratch> points_of(TreeView const& tree, SceneView const& scene,
                                                              NoScratch& none) {
    return {tree, scene.cells, scene.shown.lower, scene.shown.upper, none};
}

template <Integrator integrator, class T>
__global__ void __launch_bounds__(block_x* block_y)
    pixels_kernel(__grid_constant__ SceneView const scene, __grid_constant__ TreeView const tree, Bands bands,
                  float* pixels, unsigned long long* totals) {
    Tile const tile = pixel_of_thread(bands);
    NoScratch none;
    TreePoints<T, NoScratch> const points = points_of<T>(tree, scene, none);
    Counters counters;
    if (tile.x0 < tile.x1) draw_pixel<integrator>(points, scene, tile, pixels, counters);
    add_counters(counters, totals);
}

/// Blocks of a multiprocessor, by which registers are given out.
constexpr int blocks_of(bool through_blocks) { return through_blocks ? 4 : 3; }

/// `blocks`: it is marched through them.
template <Usual usual, bool blocks, class T>
__global__ void __launch_bounds__(block_x* block_y, blocks_of(blocks))
    usual_kernel(__grid_constant__ SceneView const scene, __grid_constant__ TreeView const tree, Bands bands,
                 float* pixels, unsigned long long* totals) {
    Tile const tile = pixel_of_thread(bands);
    NoScratch none;
    TreePoints<T, NoScratch> const points = points_of<T>(tree, scene, none);
    Counters counters;
    if (tile.x0 < tile.x1)
        for_middles(scene, tile, pixels, scene.frame.width, 1, [&](Ray const& ray) {
            constexpr Lighting lighting = usual == Usual::flat ? Lighting::flat : Lighting::open;
            if constexpr (usual == Usual::surface)
                return open_iso_ray<false>(points, scene, ray, counters);
            else if constexpr (usual == Usual::layers)
                return open_iso_ray<true>(points, scene, ray, counters);
            else if constexpr (blocks)
                return march_leaves<lighting>(points, scene, ray, counters);
            else
                return march_bricks<lighting>(points, scene, ray, counters);
        });
    add_counters(counters, totals);
}

template <Integrator integrator, class T>
void launch(SceneView const& scene, TreeView const& tree, Bands const& bands, float* pixels,
            unsigned long long* totals) {
    if (bands.count() == 0) return;
    dim3 const grid = blocks_over(bands), block(block_x, block_y);
    bool const usual = is_usual(scene);
    if constexpr (integrator == Integrator::march) {
        bool const blocks = tree.blocks.cells != nullptr, shaded = scene.shade.strength > 0;
        if (usual && blocks && shaded)
            usual_kernel<Usual::shaded, true, T><<<grid, block>>>(scene, tree, bands, pixels, totals);
        else if (usual && blocks)
            usual_kernel<Usual::flat, true, T><<<grid, block>>>(scene, tree, bands, pixels, totals);
        else if (usual && shaded)
            usual_kernel<Usual::shaded, false, T><<<grid, block>>>(scene, tree, bands, pixels, totals);
        else if (usual)
            usual_kernel<Usual::flat, false, T><<<grid, block>>>(scene, tree, bands, pixels, totals);
        if (usual) return check_launch("render");
    }
    if constexpr (integrator == Integrator::iso) {
        if (usual && has_layers(scene))
            usual_kernel<Usual::layers, false, T><<<grid, block>>>(scene, tree, bands, pixels, totals);
        else if (usual)
            usual_kernel<Usual::surface, false, T><<<grid, block>>>(scene, tree, bands, pixels, totals);
        if (usual) return check_launch("render");
    }
    pixels_kernel<integrator, T><<<grid, block>>>(scene, tree, bands, pixels, totals);
    check_launch("render");
}

} // namespace

void launch_drawing(SceneView const& scene, TreeView const& tree, Integrator integrator, Bands const& bands,
                    float* pixels, std::uint64_t* totals) {
    auto* const counts = reinterpret_cast<unsigned long long*>(totals);
    with_integrator(integrator, [&]<Integrator drawn>(std::integral_constant<Integrator, drawn>) {
        with_lattice_type(tree.type, [&]<class T>(T) { launch<drawn, T>(scene, tree, bands, pixels, counts); });
    });
}

} // namespace vkt::render
