// Pictures as volumes of display levels: three slices each, red, green and blue, 0 to 255, not rounded.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"
#include "libvkt/render/image.h"

namespace vkt::shell {

/// The three slices of one picture over an opaque background.
void put_levels(render::Image const& image, render::Color const& background, float* levels);

/// FLIP of two volumes of as many pictures of one size: the mean over a picture, of the one that differs most.
double largest_flip(Volume const& reference, Volume const& test);

} // namespace vkt::shell
