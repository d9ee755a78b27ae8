// Where in a picture something can be seen: the rest of it needs no rays.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/minmax.h"
#include "libvkt/render/tiles.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace vkt::render {

/// Squares of pixels that rays through visible macrocells may pass. A ray that passes none of these cells meets
/// nothing.
class Screen {
public:
    /// Of so many rows of the picture from `first` on. Everything may be seen where that is not worth finding out, or a
    /// cell reaches behind the eye.
    Screen(SceneView const& scene, CellVisibility const& cells, int first, int rows, int threads);

    /// Calls draw(tile) for what may be seen of a tile, and writes "nothing" to the other pixels; tiles and pixels are
    /// those of the part of the picture that the view's frame begins. Rays that meet the volume are counted as if they
    /// were drawn, and, where it is `marched`, the segments on them.
    void draw(SceneView const& view, bool marched, Tile tile, float* pixels, Counters& counters,
              std::function<void(Tile)> const& draw) const;

private:
    static constexpr int side = 4; ///< of a square

    int width_, first_;              ///< in pixels
    int across_;                     ///< squares of a row
    std::vector<std::uint8_t> seen_; ///< empty: all may be
};

} // namespace vkt::render
