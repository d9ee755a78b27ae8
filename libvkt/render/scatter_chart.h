// A chart of points over two logarithmic axes, as a picture of pixels or as SVG.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/image.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt::render {

struct ScatterPoint {
    double x = 0, y = 0; ///< x positive; a y of 0 lies on a line of its own below the axis
    /// What was predicted: drawn hollow, joined to the point.
    std::optional<double> predicted_x, predicted_y;
    bool front = false; ///< no other point is better along both axes
    bool wrong = false; ///< y is above what was predicted
    std::string label;  ///< SVG shows it beside points of the front, and of all under the pointer
};

struct ScatterChart {
    std::string title, x_label, y_label;
    std::vector<ScatterPoint> points; ///< at least one
};

/// The points, decades with their numbers, and the front as a line. Letters are capitals of five rows.
Image draw(ScatterChart const& chart, int width, int height);
std::string to_svg(ScatterChart const& chart);

} // namespace vkt::render
