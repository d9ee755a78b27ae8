// Tiles of the image, compiled once per instruction set into a namespace of its own.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tiles.h"

#include "libvkt/render/kernels/integrate.h"

namespace vkt::render::VKT_BACKEND {

namespace {

template <class T> LatticeSampler<T> sampler_of(LatticeView const& lattice) {
    return {static_cast<T const*>(lattice.data), lattice.row, lattice.slice, lattice.compact};
}

template <class T>
void run(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Tile tile, float* pixels,
         std::int64_t width, Counters& total) {
    integrate(sampler_of<T>(lattice), scene, integrator, tile, pixels, width, total);
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
