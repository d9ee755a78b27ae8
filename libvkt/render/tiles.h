// The compiled inner loops: one function per instruction set that renders one tile of the image.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/render/inner/scene.h"
#include "libvkt/render/inner/voxel_type.h"

namespace vkt::render {

/// The last three draw no light but layers, of rays through the middle of pixels: normal and distance of the nearest
/// surface, its colour, the distance at which half of the light is held back (in all four).
enum class Integrator : std::uint8_t { march, exact, iso, scatter, project, place, albedo, half_distance };

struct LatticeView {
    void const* data = nullptr; ///< voxel (0,0,0) of the padded array
    LatticeType type = LatticeType::float32;
    std::int64_t row = 0, slice = 0;
    bool compact = false;
};

struct Tile {
    int x0, y0, x1, y1;
};

/// Renders the pixels of a tile into four floats per pixel (premultiplied linear colour, transmittance);
/// `pixels` is pixel (0,0) of the image, `width` its row length. Adds to the counters.
using TileFunction = void (*)(SceneView const& scene, LatticeView const& lattice, Integrator integrator, Tile tile,
                              float* pixels, std::int64_t width, Counters& counters);

/// The same for a hierarchical volume.
struct TreeView;
using TreeTileFunction = void (*)(SceneView const& scene, TreeView const& tree, Integrator integrator, Tile tile,
                                  float* pixels, std::int64_t width, Counters& counters);

namespace baseline {
TileFunction tile_function();
TreeTileFunction tree_tile_function();
} // namespace baseline
#ifdef VKT_X86_BACKENDS
namespace avx2 {
TileFunction tile_function();
TreeTileFunction tree_tile_function();
} // namespace avx2
namespace avx512 {
TileFunction tile_function();
TreeTileFunction tree_tile_function();
} // namespace avx512
#endif

/// Those for an instruction set; they fall back to the best that was compiled.
TileFunction tile_function(InstructionSet instructions);
TreeTileFunction tree_tile_function(InstructionSet instructions);

} // namespace vkt::render
