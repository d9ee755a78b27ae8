// Light to levels, and back for FLIP.
// SPDX-License-Identifier: MIT
#include "shell/picture/picture_levels.h"

#include "libvkt/render/colormap.h"
#include "libvkt/render/flip.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace vkt::shell {
namespace {

render::Image picture(Volume const& levels, std::int64_t number) {
    Index3 const dims = levels.header().dims;
    auto const pixels = static_cast<std::size_t>(dims.x * dims.y);
    auto const* const from =
        reinterpret_cast<float const*>(levels.view().data) + 3 * pixels * static_cast<std::size_t>(number);
    render::Image image{static_cast<int>(dims.x), static_cast<int>(dims.y), std::vector<float>(4 * pixels)};
    for (std::size_t i = 0; i < pixels; ++i)
        for (std::size_t c = 0; c < 3; ++c)
            image.pixels[4 * i + c] =
                static_cast<float>(render::srgb_to_linear(static_cast<double>(from[c * pixels + i]) / 255));
    return image;
}

} // namespace

void put_levels(render::Image const& image, render::Color const& background, float* levels) {
    std::size_t const pixels = image.pixels.size() / 4;
    for (std::size_t i = 0; i < pixels; ++i) {
        std::array<float, 4> const light = render::over(image.pixels.data() + 4 * i, {background, 1});
        for (std::size_t c = 0; c < 3; ++c)
            levels[c * pixels + i] =
                static_cast<float>(255 * render::linear_to_srgb(std::clamp(static_cast<double>(light[c]), 0.0, 1.0)));
    }
}

double largest_flip(Volume const& reference, Volume const& test) {
    double largest = 0;
    for (std::int64_t number = 0; number < reference.header().dims.z / 3; ++number)
        largest = std::max(largest, render::mean_flip(picture(reference, number), picture(test, number)));
    return largest;
}

} // namespace vkt::shell
