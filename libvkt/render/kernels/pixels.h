// The pixels of a tile: what every kind of volume does alike.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/march.h"
#include "libvkt/render/tiles.h"

namespace vkt::render {

/// Calls body(x, y) for the pixels of a tile and stores what it returns.
template <class Body> VKT_HD void for_pixels(Tile tile, float* pixels, std::int64_t width, Body body) {
    for (int y = tile.y0; y < tile.y1; ++y)
        for (int x = tile.x0; x < tile.x1; ++x) {
            Radiance const r = body(x, y);
            float* out = pixels + 4 * (y * width + x);
            out[0] = r.red, out[1] = r.green, out[2] = r.blue, out[3] = r.transmittance;
        }
}

} // namespace vkt::render
