// Pictures of all directions as light: read, checked, and made ready to be sampled and to light surfaces.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/environment.h"

#include <array>
#include <memory>
#include <string>
#include <vector>

namespace vkt::render {

/// An equirectangular picture as EnvironmentView has it.
struct Environment {
    int width = 0, height = 0;
    std::vector<float> pixels;      ///< 3 * width * height, linear, finite, not negative
    std::vector<float> row_ends;    ///< height + 1
    std::vector<float> column_ends; ///< width * height
    double total = 0;               ///< integral of the brightness over all directions
    /// Integrals over all directions (x, y, z) of each colour times 1, x, y, z, xx, yy, zz, xy, xz, yz.
    std::array<std::array<double, 10>, 3> moments{};

    /// Turned by so many degrees around z, counterclockwise seen from above.
    EnvironmentView view(double degrees) const;
    std::array<double, 10> moments_of(std::size_t color, double degrees) const;
};

/// From 3 * width * height linear floats, row by row from straight up. What is negative is taken for 0. Throws
/// Error{data} for values that are infinite or not a number. O(width * height).
std::shared_ptr<Environment const> make_environment(int width, int height, std::vector<float> pixels);

/// From a file: OpenEXR, PFM, Radiance (.hdr) or PNG, by content. Throws Error{io} or Error{data}.
std::shared_ptr<Environment const> read_environment(std::string const& path);

} // namespace vkt::render
