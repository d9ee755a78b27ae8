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

/// The same for pixels that several rays pass: calls integrate(ray) for those that meet the volume.
template <class Integrate>
VKT_HD void for_rays(SceneView const& scene, Tile tile, float* pixels, std::int64_t width, Integrate integrate) {
    for_pixels(tile, pixels, width, [&](int x, int y) {
        PixelSums sums(scene, x, y);
        for (int i = 0; i < scene.rays; ++i) {
            PixelPlace const place = place_in_pixel(i, scene.rays);
            Ray ray;
            bool const meets = make_ray(scene.frame, x + place.x, y + place.y, scene.shown, ray);
            sums.add(meets ? integrate(ray) : Radiance{0, 0, 0, 1});
        }
        return sums.finish();
    });
}

/// One ray through the middle of each pixel: calls look(ray) for those that meet the volume, the others have `nothing`
/// as their fourth number.
template <class Look>
VKT_HD void for_middles(SceneView const& scene, Tile tile, float* pixels, std::int64_t width, float nothing,
                        Look look) {
    for_pixels(tile, pixels, width, [&](int x, int y) {
        Ray ray;
        if (!make_ray(scene.frame, x + 0.5, y + 0.5, scene.shown, ray)) return Radiance{0, 0, 0, nothing};
        return look(ray);
    });
}

} // namespace vkt::render
