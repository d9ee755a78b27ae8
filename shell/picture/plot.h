// Points over two logarithmic axes, drawn by gnuplot: SVG, PNG, or letters for a terminal.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {

struct PlotPoint {
    double x = 0, y = 0; ///< x positive; a y of 0 lies on a line of its own at the bottom
    /// What was predicted: drawn hollow, joined to the point.
    std::optional<double> predicted_x, predicted_y;
    bool front = false; ///< no other point is better along both axes
    bool wrong = false; ///< y is above what was predicted
    std::string label;  ///< stands beside points of the front, where there is room
};

struct Plot {
    std::string title, x_label, y_label;
    std::string x_unit;            ///< after prefixes of thousands: "s" gives "10 ms"
    std::vector<PlotPoint> points; ///< at least one
};

enum class PlotFormat : std::uint8_t { svg, png, terminal };

/// True if gnuplot is installed.
bool can_plot();
/// A whole file, or lines of text. Throws Error{resources} if gnuplot is not installed, or fails.
std::string drawn(Plot const& plot, PlotFormat format);

} // namespace vkt::shell
