// Named colour maps: smooth ways through colour space, evaluated anywhere.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace vkt::render {

/// sRGB, each in [0,1].
struct Color {
    double red = 0, green = 0, blue = 0;
    friend bool operator==(Color const&, Color const&) = default;
};

/// Names of all maps, in the order in which help shows them.
std::vector<std::string> colormap_names();
/// What others call it; empty if they call it the same.
std::string_view other_name(std::string_view map);

/// The colour at x in [0,1] (clamped). "NAME:reverse" runs the map backwards. Throws Error{usage} for unknown names.
Color colormap(std::string_view name, double x);

/// sRGB transfer curve (IEC 61966-2-1) and its inverse; values outside [0,1] are clamped.
double srgb_to_linear(double value);
double linear_to_srgb(double value);

} // namespace vkt::render
