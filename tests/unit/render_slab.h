// A slab of fog whose light has closed forms.
// SPDX-License-Identifier: MIT
#pragma once

#include "render_testing.h"

#include <cmath>

namespace vkt::render::testing {

inline double mean_of_channel(Image const& image, std::size_t channel) {
    double sum = 0;
    for (std::size_t i = channel; i < image.pixels.size(); i += 4) sum += static_cast<double>(image.pixels[i]);
    return sum / (static_cast<double>(image.width) * image.height);
}

/// A homogeneous slab across z, much wider than it is thick, of this optical thickness, seen from above.
struct Slab {
    Volume volume;
    RenderSettings settings;

    Slab(double depth, Algorithm algorithm)
        : volume(constant_volume({1000, 1000, 10}, 1.0F, {1, 1, 1})), settings(orthographic("z", 8, 8)) {
        settings.algorithm = algorithm;
        settings.camera.zoom = 100;
        settings.camera.fit = Fit::volume;
        settings.transfer = flat_transfer({1, 1, 1}, -std::expm1(-depth / 10), 1);
    }
};

/// What of a light from a direction whose cosine to the slab's upward normal is `cosine` is seen from above after one
/// scattering into the eye's direction, of all that is: the integral of e^-t e^-s(t) over the depth t.
inline double once_scattered(double depth, double cosine) {
    double const rate = 1 + 1 / cosine; // from below: e^-t e^-(depth - t) / |cosine|
    if (cosine > 0) return -std::expm1(-depth * rate) / rate;
    return std::abs(rate) < 1e-9 ? depth * std::exp(-depth) : (std::exp(depth / cosine) - std::exp(-depth)) / rate;
}

/// Henyey and Greenstein's phase function, per steradian.
inline double phase_of(double g, double cosine) {
    return (1 - g * g) / (4 * half_turn * std::pow(1 + g * g - 2 * g * cosine, 1.5));
}

} // namespace vkt::render::testing
