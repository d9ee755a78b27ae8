// What a picture says of itself within it: colour bar or legend, scale bar, axes, a caption.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/parameters.h"
#include "libvkt/render/render.h"

#include <string>
#include <vector>

namespace vkt::render {

struct Annotation {
    bool key = false;    ///< colour bar, values of surfaces or names of labels; scale bar, axes
    std::string caption; ///< below, in as many lines as it takes; empty: none
    std::string font;    ///< a file; empty: default_font()

    bool any() const { return key || !caption.empty(); }
    void declare(Parameters& list);
    /// Throws Error{usage} for a font that nothing is written in.
    void check() const;
};

/// What a picture of this size needs for it at its right and lower edge. Throws what annotate() throws.
Insets insets_of(Annotation const& annotation, int width, int height);

/// 1, 2 or 5 times a power of ten, the greatest not above the limit.
double round_length(double limit);
/// The unit of lengths in the world; empty where the header does not say one, or several.
std::string length_unit(Header const& header);
/// A multiple of a step of round_length(), without the digits that rounding leaves behind.
std::string tick_text(double value, double step);
/// At least three and at most eight multiples of such a step in [lower, upper]; both ends if these are equal.
std::vector<double> ticks_of(double lower, double upper);

/// Draws it over the picture, in black or white, whatever is further from the background. The scale bar is a length in
/// the world, at the camera's target. Throws what draw_text() and default_font() throw.
void annotate(Image& image, RenderReport const& report, Header const& header, Background const& background,
              Annotation const& annotation);

} // namespace vkt::render
