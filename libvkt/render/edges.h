// Surfaces with smooth edges: more rays where a pixel is not what its neighbours are.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/passes.h"

namespace vkt::render {

/// About as many levels of 8-bit display do a pixel and one beside it differ where an edge of a surface passes.
inline constexpr double levels_of_edge = 24;

/// Draws the pixels of a picture, of one ray each, again with so many rays (a power of two) where one of their four
/// neighbours is different: where a surface ends, before another one or the background, and where its light changes as
/// quickly. What lies between two rays and meets neither is not found. It depends on nothing but the pixels around:
/// neither on threads nor on the part that is drawn. `fine` may be the picture with so many rays everywhere, from which
/// these pixels are taken then. Sets Quality::edges and stopped.
void smooth_edges(Drawing const& drawing, int rays, Image const* fine, Image& image, Counters& total, Quality& quality);

} // namespace vkt::render
