// Tiles of the image, compiled once per instruction set into a namespace of its own.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tiles.h"

#include "libvkt/render/kernels/integrate.h"

namespace vkt::render::VKT_BACKEND {

namespace {

void render_tile(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Tile tile, float* pixels,
                 std::int64_t width, Counters& counters) {
    LatticeSampler<AnyVoxel> const sampler{lattice.data, lattice.row, lattice.slice, lattice.compact, lattice.type};
    integrate(sampler, scene, integrator, tile, pixels, width, counters);
}

} // namespace

TileFunction tile_function() { return render_tile; }

} // namespace vkt::render::VKT_BACKEND
