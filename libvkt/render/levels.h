// What linear light is on a display: levels of 255.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace vkt::render {

/// Linear light, over the background, as display levels; the fourth is alpha, of pictures that keep it.
class Levels {
public:
    explicit Levels(Background const& background)
        : behind_{srgb_to_linear(background.color.red), srgb_to_linear(background.color.green),
                  srgb_to_linear(background.color.blue)},
          clear_(background.alpha < 1) {}

    double behind(std::size_t c) const { return behind_[c]; }
    /// Linear light that is shown in channel c.
    template <class T> double shown(T const* light, std::size_t c) const {
        return c < 3 ? static_cast<double>(light[c]) + static_cast<double>(light[3]) * behind_[c]
                     : static_cast<double>(light[3]);
    }
    /// Levels per linear light there.
    double slope(double shown, std::size_t c) const {
        if (c == 3) return clear_ ? 255 : 0;
        double const v = std::min(shown, 1.0);
        return 255 * (v <= 0.0031308 ? 12.92 : 1.055 / 2.4 * std::pow(v, 1 / 2.4 - 1));
    }
    double level(double shown, std::size_t c) const {
        if (c == 3) return clear_ ? 255 * shown : 0;
        return 255 * linear_to_srgb(std::clamp(shown, 0.0, 1.0));
    }
    /// Largest difference of two pixels over the channels.
    double apart(float const* a, float const* b) const {
        double most = 0;
        for (std::size_t c = 0; c < 4; ++c)
            most = std::max(most, std::abs(level(shown(a, c), c) - level(shown(b, c), c)));
        return most;
    }

private:
    std::array<double, 3> behind_;
    bool clear_;
};

} // namespace vkt::render
