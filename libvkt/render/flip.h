// LDR-FLIP: how different two pictures look when one flips between them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/image.h"

#include <vector>

namespace vkt::render {

/// Pixels per degree of the paper's viewer: 0.7 m in front of a screen 0.7 m and 3840 pixels wide.
inline constexpr double flip_pixels_per_degree = 67.0206432765823;

/// The error of every pixel, 0 to 1, row by row (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild,
/// FLIP: A Difference Evaluator for Alternating Images, 2020). Colours are those of the light, limited to 0 to 1; what
/// shines through counts as black. Both pictures have the same size. O(pixels * pixels_per_degree).
std::vector<float> flip(Image const& reference, Image const& test, double pixels_per_degree = flip_pixels_per_degree);

/// The mean of these errors.
double mean_flip(Image const& reference, Image const& test);

} // namespace vkt::render
