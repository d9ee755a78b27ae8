// Ray marching with fewer rays and longer steps where that changes no pixel by more than a tolerance.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/passes.h"

namespace vkt::render {

/// Rows beyond a part, each way, that decide about its pixels and are held with it.
inline constexpr int sparse_halo = 12;

/// The picture of draw_once() by marching, every pixel of it within about `tolerance` levels of 8-bit display over an
/// opaque background. Blocks of 4 x 4 pixels are looked at; their corners are drawn as asked for, and also with 2, 4
/// and 8 times the step, as long as that changes them by less than a part of the tolerance. The other pixels of a
/// block take the longest step that all 16 corners around it allow. Where the corners bend little and the pixel in the
/// middle of a block and of its neighbours is what a cubic through the corners says (Catmull and Rom), this gives the
/// others; elsewhere all are drawn, and once more with the step that was asked for if with a longer one they are not
/// about what the corners say: then something is there that these did not meet. Errors are estimates; the tests
/// measure them. What is decided depends on nothing but the pixels around: neither on threads nor on the part that is
/// drawn.
Quality draw_sparsely(Drawing const& drawing, double tolerance, Image& image, Counters& total, Savings& savings);

} // namespace vkt::render
