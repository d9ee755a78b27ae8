// Tiles of the image of a hierarchical volume, compiled once per instruction set into a namespace of its own.
// SPDX-License-Identifier: MIT
#ifndef VKT_BACKEND_cuda // rays hold lists that grow: a GPU needs another loop around the same march

#include "libvkt/render/inner/tree_march.h"
#include "libvkt/render/kernels/pixels.h"

namespace vkt::render::VKT_BACKEND {

namespace {

template <class T>
void run(SceneView const& scene, TreeView const& tree, Tile tile, float* pixels, std::int64_t width, Counters& total) {
    struct Owner : TreeScratch { // internal, as march_tree() wants it
        ~Owner() { release(); }
    } scratch;
    for_rays(scene, tile, pixels, width,
             [&](Ray const& ray) { return march_tree<T>(tree, scene, ray, scratch, total); });
}

void render_tile(SceneView const& scene, TreeView const& tree, Tile tile, float* pixels, std::int64_t width,
                 Counters& counters) {
    switch (tree.type) {
    case LatticeType::uint8:
        return run<std::uint8_t>(scene, tree, tile, pixels, width, counters);
    case LatticeType::uint16:
        return run<std::uint16_t>(scene, tree, tile, pixels, width, counters);
    case LatticeType::int16:
        return run<std::int16_t>(scene, tree, tile, pixels, width, counters);
    case LatticeType::float32:
        return run<float>(scene, tree, tile, pixels, width, counters);
    }
}

} // namespace

TreeTileFunction tree_tile_function() { return render_tile; }

} // namespace vkt::render::VKT_BACKEND

#endif
