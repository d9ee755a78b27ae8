// Light from all around: what arrives from a direction, and directions drawn by how bright they are.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/vector.h"

#include <cmath>
#include <cstdint>

namespace vkt::render {

/// A picture of all directions, equirectangular: rows from straight up (world +z) to straight down, the middle column
/// in the direction of +y, to its right +x. Every pixel is one light over the part of the sphere that it covers.
struct EnvironmentView {
    float const* pixels = nullptr;      ///< red, green, blue of each, linear; null: there is no picture
    float const* row_ends = nullptr;    ///< share of all brightness in the rows before, height + 1 numbers from 0 to 1
    float const* column_ends = nullptr; ///< the same of a row's pixels, width numbers per row, up to each one's end
    int width = 0, height = 0;
    float per_total = 0;         ///< 1 / integral of the brightness over all directions; 0: all is dark
    double cosine = 1, sine = 0; ///< of the angle by which it is turned around z, counterclockwise from above
};

/// Brightness by which directions are drawn: any that is above 0 where there is light gives the right mean.
VKT_HD float brightness_of(float const* pixel) {
    float const rg = pixel[0] > pixel[1] ? pixel[0] : pixel[1];
    return rg > pixel[2] ? rg : pixel[2];
}

inline constexpr double half_turn = 3.14159265358979323846;

/// The pixel that a direction of unit length meets.
VKT_HD float const* light_from(EnvironmentView const& e, Double3 direction) {
    double const x = e.cosine * direction.x + e.sine * direction.y, y = e.cosine * direction.y - e.sine * direction.x;
    double const z = direction.z < -1 ? -1 : direction.z > 1 ? 1 : direction.z;
    int const u = static_cast<int>((0.5 + std::atan2(x, y) / (2 * half_turn)) * e.width);
    int const v = static_cast<int>(std::acos(z) / half_turn * e.height);
    std::int64_t const row = v < e.height ? v : e.height - 1, column = u < e.width ? u : e.width - 1;
    return e.pixels + 3 * (row * e.width + column);
}

/// How likely sampled_light() draws this pixel's light, per steradian.
VKT_HD float likelihood_of(EnvironmentView const& e, float const* pixel) { return brightness_of(pixel) * e.per_total; }

/// The number of ends at or before `share`; that of the last pixel of any light at most.
VKT_HD int drawn_from(float const* ends, int count, float share) {
    int low = 0, high = count - 1;
    while (low < high) {
        int const middle = (low + high) / 2;
        if (ends[middle] > share)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

struct SampledLight {
    Double3 direction; ///< in the world, of unit length
    float const* pixel;
};

/// A direction by four uniform numbers in [0, 1): its likelihood is proportional to the brightness of the pixel and
/// the same all over it. There must be light.
VKT_HD SampledLight sampled_light(EnvironmentView const& e, float row_share, float column_share, float across,
                                  float down) {
    int const v = drawn_from(e.row_ends + 1, e.height, row_share);
    int const u = drawn_from(e.column_ends + static_cast<std::int64_t>(v) * e.width, e.width, column_share);
    double const upper = std::cos(half_turn * v / e.height), lower = std::cos(half_turn * (v + 1) / e.height);
    double const z = upper + static_cast<double>(down) * (lower - upper);
    double const angle = 2 * half_turn * ((u + static_cast<double>(across)) / e.width - 0.5);
    double const r = std::sqrt(1 - z * z > 0 ? 1 - z * z : 0.0);
    double const x = r * std::sin(angle), y = r * std::cos(angle);
    return {{e.cosine * x - e.sine * y, e.sine * x + e.cosine * y, z},
            e.pixels + 3 * (static_cast<std::int64_t>(v) * e.width + u)};
}

} // namespace vkt::render
