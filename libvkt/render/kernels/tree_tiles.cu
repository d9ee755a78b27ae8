// The picture of a hierarchical volume on a GPU: a thread a pixel, with the inner loops of the CPU, but for lists.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/render/device.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/inner/iso.h"
#include "libvkt/render/inner/piece_walk.h"
#include "libvkt/render/inner/project.h"
#include "libvkt/render/inner/scatter.h"
#include "libvkt/render/inner/segment_march.h"
#include "libvkt/render/kernels/device_pixels.h"

namespace vkt::render {
namespace {

template <Integrator integrator, class T>
__global__ void __launch_bounds__(block_x* block_y)
    pixels_kernel(__grid_constant__ SceneView const scene, __grid_constant__ TreeView const tree, Bands bands,
                  float* pixels, unsigned long long* totals) {
    Tile const tile = pixel_of_thread(bands);
    NoScratch none;
    TreePoints<T, NoScratch> const points{tree, scene.cells, scene.shown.lower, scene.shown.upper, none};
    Counters counters;
    if (tile.x0 < tile.x1) {
        if constexpr (integrator == Integrator::scatter)
            for_pixels(tile, pixels, scene.frame.width,
                       [&](int px, int py) { return scatter_pixel(points, scene, px, py, counters); });
        else
            for_rays(scene, tile, pixels, scene.frame.width, [&](Ray const& ray) {
                if constexpr (integrator == Integrator::march) return march_ray(points, scene, ray, counters);
                if constexpr (integrator == Integrator::exact) return exact_ray(points, scene, ray, counters);
                if constexpr (integrator == Integrator::iso) return iso_ray(points, scene, ray, counters);
                if constexpr (integrator == Integrator::project) return project_ray(points, scene, ray, counters);
            });
    }
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
    TreePoints<T, NoScratch> const points{tree, scene.cells, scene.shown.lower, scene.shown.upper, none};
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

template <Integrator integrator>
void launch_type(SceneView const& scene, TreeView const& tree, Bands const& bands, float* pixels,
                 unsigned long long* totals) {
    switch (tree.type) {
    case LatticeType::uint8:
        return launch<integrator, std::uint8_t>(scene, tree, bands, pixels, totals);
    case LatticeType::uint16:
        return launch<integrator, std::uint16_t>(scene, tree, bands, pixels, totals);
    case LatticeType::int16:
        return launch<integrator, std::int16_t>(scene, tree, bands, pixels, totals);
    case LatticeType::float32:
        return launch<integrator, float>(scene, tree, bands, pixels, totals);
    }
}

} // namespace

void launch_drawing(SceneView const& scene, TreeView const& tree, Integrator integrator, Bands const& bands,
                    float* pixels, std::uint64_t* totals) {
    auto* const counts = reinterpret_cast<unsigned long long*>(totals);
    switch (integrator) {
    case Integrator::march:
        return launch_type<Integrator::march>(scene, tree, bands, pixels, counts);
    case Integrator::exact:
        return launch_type<Integrator::exact>(scene, tree, bands, pixels, counts);
    case Integrator::iso:
        return launch_type<Integrator::iso>(scene, tree, bands, pixels, counts);
    case Integrator::project:
        return launch_type<Integrator::project>(scene, tree, bands, pixels, counts);
    case Integrator::scatter:
        return launch_type<Integrator::scatter>(scene, tree, bands, pixels, counts);
    default:
        throw Error(ErrorKind::failure, "what is beside a picture is not drawn on a GPU");
    }
}

} // namespace vkt::render
