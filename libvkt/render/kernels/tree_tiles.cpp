// Tiles of the image of a hierarchical volume, compiled once per instruction set into a namespace of its own.
// SPDX-License-Identifier: MIT
#include "libvkt/render/inner/tree_march.h"
#include "libvkt/render/inner/tree_pieces.h"
#include "libvkt/render/kernels/integrate.h"

namespace vkt::render::VKT_BACKEND {

namespace {

void render_tile(SceneView const& scene, TreeView const& tree, Integrator integrator, Tile tile, float* pixels,
                 std::int64_t width, Counters& counters) {
    struct Owner : TreeScratch { // internal, as march_tree() wants it
        ~Owner() { release(); }
    } scratch;
    TreePoints<AnyVoxel, Owner> const points{tree, scene.cells, scene.shown.lower, scene.shown.upper, scratch};
    integrate(points, scene, integrator, tile, pixels, width, counters);
}

} // namespace

TreeTileFunction tree_tile_function() { return render_tile; }

} // namespace vkt::render::VKT_BACKEND
