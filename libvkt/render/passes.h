// Pictures drawn in passes until they are good enough: paths tile by tile, rays pixel by pixel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/goal.h"
#include "libvkt/render/image.h"
#include "libvkt/render/tiles.h"

#include <chrono>
#include <functional>
#include <vector>

namespace vkt::render {

/// Edge of a tile, in pixels.
inline constexpr int tile_side = 16;
/// Most paths per pixel where --noise or --time decide, and most rays of a pixel with --tolerance.
inline constexpr int most_paths = 1 << 20, most_rays = 1024;

/// One picture, or a part of one, that is being drawn. `draw` writes the pixels of a tile, four floats each, into an
/// image of the picture's width, whose first row is row scene.frame.top of the picture, and may be called by many
/// threads at once.
struct Drawing {
    using Draw = std::function<void(SceneView const& scene, Tile tile, float* pixels, Counters& counters)>;
    Draw draw;
    SceneView scene;
    Background background; ///< over which errors are measured
    Goal goal;
    Watch watch;
    int threads = 1;
    /// Of paths: if not null, three planes of the variance of each pixel's mean, over the background; 0 where one path
    /// is all there is.
    std::vector<float>* variance = nullptr;
    std::chrono::steady_clock::time_point start;
};

/// One pass over all pixels.
Quality draw_once(Drawing const& drawing, Image& image, Counters& total);

/// scene.samples paths in every pixel, or, with a goal, up to so many. Without a goal the picture is, bit for bit, that
/// of one pass.
///
/// How many paths the pixels of a tile get for --noise is decided from the variance of 16 others a pixel, with random
/// numbers of their own, which are no part of the picture (two-stage sampling: Kirk and Arvo, Unbiased Sampling
/// Techniques for Image Synthesis, 1991): the number does not depend on the light that is averaged, so that stopping
/// adds no bias. The error that is reported is estimated from the difference of the paths of odd and of even number.
Quality draw_paths(Drawing const& drawing, Image& image, Counters& total);

/// What is known of a picture of so many paths in every pixel, by the sums of all of them and of those of odd number.
Quality quality_of_paths(Drawing const& drawing, int width, int paths, std::vector<double> const& light,
                         std::vector<double> const& odd);

/// Rays until the error of each pixel is estimated to be below the tolerance.
///
/// Step: rays through the middle of the pixels are marched with half the step until that changes their colour by less
/// than a third of the tolerance; the change is taken for twice the error of the shorter one, while in theory it is
/// three times it. Edges: 4, 16, 64 … rays a pixel, while the change from a quarter as many (whose error is 4^(3/4)
/// times as large along edges) or the spread within the pixel ask for more. Pixels are refined together with their
/// eight neighbours, so that an edge that all rays of one pixel missed is found by those of the next.
/// `stepped`: the scene's step matters.
Quality draw_adaptively(Drawing const& drawing, bool stepped, Image& image, Counters& total);

} // namespace vkt::render
