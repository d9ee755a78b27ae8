// Tiles of the image, compiled once per instruction set into a namespace of its own.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tiles.h"

#include "libvkt/render/kernels/integrate.h"

namespace vkt::render::VKT_BACKEND {

namespace {

template <class T> LatticeSampler<T> sampler_of(LatticeView const& lattice) {
    return {static_cast<T const*>(lattice.data), lattice.row, lattice.slice, lattice.compact};
}

void render_tile(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Tile tile, float* pixels,
                 std::int64_t width, Counters& counters) {
    with_lattice_type(lattice.type, [&]<class T>(T) {
        integrate(sampler_of<T>(lattice), scene, integrator, tile, pixels, width, counters);
    });
}

} // namespace

TileFunction tile_function() { return render_tile; }

} // namespace vkt::render::VKT_BACKEND
