// Pixels of a picture that threads of a GPU draw, one each: what every kind of volume does alike there.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/render/device.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/inner/project.h"
#include "libvkt/render/inner/scatter.h"
#include "libvkt/render/kernels/pixels.h"

#include <type_traits>

namespace vkt::render {

// Internal: kernels are.
namespace {

/// Pixels of a block: rays of a warp stay together in an 8 x 4 patch.
constexpr int block_x = 8, block_y = Bands::rows_of_band;

/// The blocks that bands take.
dim3 blocks_over(Bands const& bands) {
    return {static_cast<unsigned>((bands.part.x1 - bands.part.x0 + block_x - 1) / block_x),
            static_cast<unsigned>(bands.count())};
}

/// The pixel of a thread as a tile; nothing if that is none of the part's.
__device__ __forceinline__ Tile pixel_of_thread(Bands const& bands) {
    Tile const& part = bands.part;
    int const x = part.x0 + static_cast<int>(blockIdx.x * block_x + threadIdx.x),
              y = bands.row(static_cast<int>(blockIdx.y)) + static_cast<int>(threadIdx.y);
    return x < part.x1 && y < part.y1 ? Tile{x, y, x + 1, y + 1} : Tile{0, 0, 0, 0};
}

/// What a thread draws where nothing is left out of the loop.
template <Integrator integrator, class S>
__device__ __forceinline__ void draw_pixel(S const& sampler, SceneView const& scene, Tile tile, float* pixels,
                                           Counters& counters) {
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

/// Calls f with a constant, which pictures are compiled for.
template <class F> void with_integrator(Integrator integrator, F const& f) {
    switch (integrator) {
    case Integrator::march:
        return f(std::integral_constant<Integrator, Integrator::march>{});
    case Integrator::exact:
        return f(std::integral_constant<Integrator, Integrator::exact>{});
    case Integrator::iso:
        return f(std::integral_constant<Integrator, Integrator::iso>{});
    case Integrator::project:
        return f(std::integral_constant<Integrator, Integrator::project>{});
    case Integrator::scatter:
        return f(std::integral_constant<Integrator, Integrator::scatter>{});
    default:
        throw Error(ErrorKind::failure, "what is beside a picture is not drawn on a GPU");
    }
}

/// Adds what every thread of a block counted.
__device__ __forceinline__ void add_counters(Counters const& counters, unsigned long long* totals) {
    int const lane = static_cast<int>(threadIdx.y * block_x + threadIdx.x) % 32;
    std::int64_t const own[4] = {counters.rays, counters.segments, counters.samples, counters.capped};
    for (int i = 0; i < 4; ++i) {
        auto sum = static_cast<unsigned long long>(own[i]);
        for (int half = 16; half > 0; half /= 2) sum += __shfl_down_sync(~0u, sum, half);
        if (lane == 0 && sum != 0) atomicAdd(totals + i, sum);
    }
}

/// What the loops of the usual pictures are compiled for: one ray a pixel, of which nothing is kept but the light, and
/// which meets nothing that holds back the light on it. They hold fewer numbers.
enum class Usual : std::uint8_t { flat, shaded, surface, layers };

bool is_usual(SceneView const& scene) {
    return scene.rays == 1 && scene.before == 0 && scene.sums.light == nullptr && scene.sums.odd == nullptr &&
           scene.sums.squares == nullptr && !scene.lamp.shadows && scene.around_count == 0 && !scene.around.on;
}

} // namespace

} // namespace vkt::render
