// A chart of bars, such as a histogram's, as a picture of pixels or as SVG.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/image.h"

#include <string>
#include <vector>

namespace vkt::render {

struct BarChart {
    std::vector<double> heights; ///< 0 to 1, at least one
    std::string low, high;       ///< at the ends of the axis
    std::string top;             ///< what a height of 1 stands for
};

/// Bars side by side over the whole width, from the bottom; where there are more bars than pixels the highest of each
/// pixel's. A bar that is not 0 is at least a pixel high.
Image draw(BarChart const& chart, int width, int height);
/// The background that draw() is meant for.
Background chart_background();
/// A file with the same bars, and the labels.
std::string to_svg(BarChart const& chart);

} // namespace vkt::render
