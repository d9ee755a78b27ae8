// The picture on a GPU: a thread a pixel, with the inner loops of the CPU.
// SPDX-License-Identifier: MIT
#include "libvkt/render/device.h"

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/inner/iso.h"
#include "libvkt/render/inner/project.h"
#include "libvkt/render/inner/scatter.h"
#include "libvkt/render/kernels/pixels.h"

namespace vkt::render {
namespace {

/// Pixels of a block: rays of a warp stay together in an 8 x 4 patch.
constexpr int block_x = 8, block_y = 16;

/// Adds what every thread of a block counted.
__device__ void add_counters(Counters const& counters, int lane, unsigned long long* totals) {
    std::int64_t const own[4] = {counters.rays, counters.segments, counters.samples, counters.capped};
    for (int i = 0; i < 4; ++i) {
        auto sum = static_cast<unsigned long long>(own[i]);
        for (int half = 16; half > 0; half /= 2) sum += __shfl_down_sync(~0u, sum, half);
        if (lane == 0 && sum != 0) atomicAdd(totals + i, sum);
    }
}

template <Integrator integrator, class T>
__global__ void __launch_bounds__(block_x* block_y)
    pixels_kernel(__grid_constant__ SceneView const scene, LatticeSampler<T> sampler, Tile part, float* pixels,
                  unsigned long long* totals) {
    int const x = part.x0 + static_cast<int>(blockIdx.x * block_x + threadIdx.x),
              y = part.y0 + static_cast<int>(blockIdx.y * block_y + threadIdx.y);
    Counters counters;
    if (x < part.x1 && y < part.y1) {
        Tile const tile{x, y, x + 1, y + 1};
        if constexpr (integrator == Integrator::scatter)
            for_pixels(tile, pixels, scene.frame.width,
                       [&](int px, int py) { return scatter_pixel(sampler, scene, px, py, counters); });
        else
            for_rays(scene, tile, pixels, scene.frame.width, [&](Ray const& ray) {
                if constexpr (integrator == Integrator::march) return march_ray(sampler, scene, ray, counters);
                if constexpr (integrator == Integrator::exact) return exact_ray(sampler, scene, ray, counters);
                if constexpr (integrator == Integrator::iso) return iso_ray(sampler, scene, ray, counters);
                if constexpr (integrator == Integrator::project) return project_ray(sampler, scene, ray, counters);
            });
    }
    add_counters(counters, static_cast<int>(threadIdx.y * block_x + threadIdx.x) % 32, totals);
}

/// What the loops of the usual pictures are compiled for: one ray a pixel, of which nothing is kept but the light, and
/// which meets nothing that holds back the light on it. They hold fewer numbers.
enum class Usual : std::uint8_t { flat, shaded, surface, layers };

/// Blocks of a multiprocessor, by which registers are given out; measured.
constexpr int blocks_of(Usual usual) { return usual == Usual::flat ? 6 : usual == Usual::shaded ? 5 : 4; }

template <Usual usual, class T>
__global__ void __launch_bounds__(block_x* block_y, blocks_of(usual))
    usual_kernel(__grid_constant__ SceneView const scene, LatticeSampler<T> sampler, Tile part, float* pixels,
                 unsigned long long* totals) {
    int const x = part.x0 + static_cast<int>(blockIdx.x * block_x + threadIdx.x),
              y = part.y0 + static_cast<int>(blockIdx.y * block_y + threadIdx.y);
    Counters counters;
    if (x < part.x1 && y < part.y1)
        for_middles(scene, Tile{x, y, x + 1, y + 1}, pixels, scene.frame.width, 1, [&](Ray const& ray) {
            if constexpr (usual == Usual::flat) return march_lit<Lighting::flat>(sampler, scene, ray, counters);
            if constexpr (usual == Usual::shaded) return march_lit<Lighting::open>(sampler, scene, ray, counters);
            if constexpr (usual == Usual::surface) return open_iso_ray<false>(sampler, scene, ray, counters);
            if constexpr (usual == Usual::layers) return open_iso_ray<true>(sampler, scene, ray, counters);
        });
    add_counters(counters, static_cast<int>(threadIdx.y * block_x + threadIdx.x) % 32, totals);
}

template <Integrator integrator, class T>
void launch(SceneView const& scene, LatticeView const& lattice, Tile part, float* pixels, unsigned long long* totals) {
    if (part.y1 <= part.y0) return;
    dim3 const grid(static_cast<unsigned>((part.x1 - part.x0 + block_x - 1) / block_x),
                    static_cast<unsigned>((part.y1 - part.y0 + block_y - 1) / block_y)),
        block(block_x, block_y);
    LatticeSampler<T> const sampler{static_cast<T const*>(lattice.data), lattice.row, lattice.slice, lattice.compact};
    bool const usual = scene.rays == 1 && scene.before == 0 && scene.sums.light == nullptr &&
                       scene.sums.odd == nullptr && scene.sums.squares == nullptr && !scene.lamp.shadows &&
                       scene.around_count == 0;
    if constexpr (integrator == Integrator::march) {
        if (usual && scene.shade.strength > 0)
            usual_kernel<Usual::shaded, T><<<grid, block>>>(scene, sampler, part, pixels, totals);
        else if (usual)
            usual_kernel<Usual::flat, T><<<grid, block>>>(scene, sampler, part, pixels, totals);
        if (usual) return check_launch("render");
    }
    if constexpr (integrator == Integrator::iso) {
        if (usual && has_layers(scene))
            usual_kernel<Usual::layers, T><<<grid, block>>>(scene, sampler, part, pixels, totals);
        else if (usual)
            usual_kernel<Usual::surface, T><<<grid, block>>>(scene, sampler, part, pixels, totals);
        if (usual) return check_launch("render");
    }
    pixels_kernel<integrator, T><<<grid, block>>>(scene, sampler, part, pixels, totals);
    check_launch("render");
}

template <Integrator integrator>
void launch_type(SceneView const& scene, LatticeView const& lattice, Tile part, float* pixels,
                 unsigned long long* totals) {
    switch (lattice.type) {
    case LatticeType::uint8:
        return launch<integrator, std::uint8_t>(scene, lattice, part, pixels, totals);
    case LatticeType::uint16:
        return launch<integrator, std::uint16_t>(scene, lattice, part, pixels, totals);
    case LatticeType::int16:
        return launch<integrator, std::int16_t>(scene, lattice, part, pixels, totals);
    case LatticeType::float32:
        return launch<integrator, float>(scene, lattice, part, pixels, totals);
    }
}

} // namespace

void launch_drawing(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Tile part, float* pixels,
                    std::uint64_t* totals) {
    auto* const counts = reinterpret_cast<unsigned long long*>(totals);
    switch (integrator) {
    case Integrator::march:
        return launch_type<Integrator::march>(scene, lattice, part, pixels, counts);
    case Integrator::exact:
        return launch_type<Integrator::exact>(scene, lattice, part, pixels, counts);
    case Integrator::iso:
        return launch_type<Integrator::iso>(scene, lattice, part, pixels, counts);
    case Integrator::project:
        return launch_type<Integrator::project>(scene, lattice, part, pixels, counts);
    case Integrator::scatter:
        return launch_type<Integrator::scatter>(scene, lattice, part, pixels, counts);
    default:
        throw Error(ErrorKind::failure, "what is beside a picture is not drawn on a GPU");
    }
}

} // namespace vkt::render
