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

#include <algorithm>

namespace vkt::render {
namespace {

/// Pixels of a block: rays of a warp stay together in an 8 x 4 patch.
constexpr int block_x = 8, block_y = 16;
/// The same where blocks share a copy of the table.
constexpr int wide_x = 16, wide_y = 16;
/// Nodes of a table that fits there.
constexpr int most_nodes = 1024;

template <class T> LatticeSampler<T> sampler_of(LatticeView const& lattice) {
    return {static_cast<T const*>(lattice.data), lattice.row, lattice.slice, lattice.compact};
}

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

/// One ray a pixel, of which nothing is kept but the light, where nothing holds back the light on what it meets: what
/// is asked for most. The loops hold fewer numbers.
template <Integrator integrator, Lighting lighting, class T>
__global__ void __launch_bounds__(wide_x* wide_y)
    single_rays_kernel(__grid_constant__ SceneView const scene, LatticeSampler<T> sampler, Tile part, float* pixels,
                       unsigned long long* totals) {
    // Warps are patches of 8 x 4 pixels, two side by side.
    int const lane = static_cast<int>(threadIdx.x) % 32, warp = static_cast<int>(threadIdx.x) / 32;
    int const x = part.x0 + static_cast<int>(blockIdx.x) * wide_x + warp % 2 * 8 + lane % 8,
              y = part.y0 + static_cast<int>(blockIdx.y) * wide_y + warp / 2 * 4 + lane / 8;
    __shared__ Quad nodes[integrator == Integrator::march ? 2 * most_nodes : 1];
    TableView table = scene.table;
    if constexpr (integrator == Integrator::march) {
        for (int i = static_cast<int>(threadIdx.x); i < 2 * table.count; i += wide_x * wide_y)
            nodes[i] = scene.table.nodes[i];
        __syncthreads();
        table.nodes = nodes;
    }
    Counters counters;
    if (x < part.x1 && y < part.y1)
        for_middles(scene, Tile{x, y, x + 1, y + 1}, pixels, scene.frame.width, 1, [&](Ray const& ray) {
            if constexpr (integrator == Integrator::march)
                return march_lit<lighting>(sampler, scene, table, ray, counters);
            if constexpr (integrator == Integrator::iso) return open_iso_ray(sampler, scene, ray, counters);
        });
    add_counters(counters, lane, totals);
}

dim3 blocks_of(Tile part, int across, int down) {
    return {static_cast<unsigned>((part.x1 - part.x0 + across - 1) / across),
            static_cast<unsigned>((part.y1 - part.y0 + down - 1) / down)};
}

template <Integrator integrator, Lighting lighting, class T>
void launch_single(SceneView const& scene, LatticeView const& lattice, Tile part, float* pixels,
                   unsigned long long* totals) {
    single_rays_kernel<integrator, lighting, T><<<blocks_of(part, wide_x, wide_y), wide_x * wide_y>>>(
        scene, sampler_of<T>(lattice), part, pixels, totals);
}

template <Integrator integrator, class T>
void launch(SceneView const& scene, LatticeView const& lattice, Tile part, float* pixels, unsigned long long* totals) {
    if (part.y1 <= part.y0) return;
    bool const alone = scene.rays == 1 && scene.before == 0 && scene.sums.light == nullptr &&
                       scene.sums.odd == nullptr && scene.sums.squares == nullptr;
    bool const open = !scene.lamp.shadows && scene.around_count == 0;
    bool const opaque = std::all_of(scene.isos, scene.isos + scene.iso_count, [](auto& iso) { return iso.alpha >= 1; });
    if constexpr (integrator == Integrator::march) {
        if (alone && open && scene.table.count <= most_nodes) {
            if (scene.shade.strength > 0)
                launch_single<integrator, Lighting::open, T>(scene, lattice, part, pixels, totals);
            else
                launch_single<integrator, Lighting::flat, T>(scene, lattice, part, pixels, totals);
            return check_launch("render");
        }
    }
    if constexpr (integrator == Integrator::iso) {
        if (alone && open && opaque) {
            launch_single<integrator, Lighting::open, T>(scene, lattice, part, pixels, totals);
            return check_launch("render");
        }
    }
    pixels_kernel<integrator, T><<<blocks_of(part, block_x, block_y), dim3(block_x, block_y)>>>(
        scene, sampler_of<T>(lattice), part, pixels, totals);
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
