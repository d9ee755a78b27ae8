// Bars: rectangles of pixels, and of SVG.
// SPDX-License-Identifier: MIT
#include "libvkt/render/bar_chart.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>

namespace vkt::render {
namespace {

constexpr Color bar_color{0.20, 0.38, 0.65};

std::string escaped(std::string const& text) {
    std::string result;
    for (char const c : text) result += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
    return result;
}

} // namespace

Image draw(BarChart const& chart, int width, int height) {
    Image image;
    image.width = width;
    image.height = height;
    image.pixels.assign(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0.0F);
    auto const bars = static_cast<std::int64_t>(chart.heights.size());
    for (std::int64_t x = 0; x < width; ++x) {
        std::int64_t const first = x * bars / width, end = std::max(first + 1, (x + 1) * bars / width);
        double const share = *std::max_element(chart.heights.begin() + first, chart.heights.begin() + end);
        auto const filled = static_cast<int>(std::ceil(std::clamp(share, 0.0, 1.0) * height));
        for (int y = 0; y < height; ++y) {
            float* const p = image.pixels.data() + 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                                        static_cast<std::size_t>(x));
            p[3] = 1;
            if (y < height - filled) continue;
            p[0] = static_cast<float>(srgb_to_linear(bar_color.red));
            p[1] = static_cast<float>(srgb_to_linear(bar_color.green));
            p[2] = static_cast<float>(srgb_to_linear(bar_color.blue));
            p[3] = 0;
        }
    }
    return image;
}

Background chart_background() { return {{1, 1, 1}, 1}; }

std::string to_svg(BarChart const& chart) {
    constexpr double width = 640, height = 360, margin = 24;
    std::string svg = text("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 ", width + 2 * margin, " ",
                           height + 2 * margin, "\" font-family=\"sans-serif\" font-size=\"12\">\n",
                           "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<g fill=\"#3361a6\">\n");
    double const bar = width / static_cast<double>(chart.heights.size());
    for (std::size_t i = 0; i < chart.heights.size(); ++i) {
        double const high = chart.heights[i] * height;
        if (high > 0)
            svg += text("<rect x=\"", margin + static_cast<double>(i) * bar, "\" y=\"", margin + height - high,
                        "\" width=\"", bar, "\" height=\"", high, "\"/>\n");
    }
    double const below = margin + height + 16;
    return svg + text("</g>\n<text x=\"", margin, "\" y=\"", below, "\">", escaped(chart.low), "</text>\n<text x=\"",
                      margin + width, "\" y=\"", below, "\" text-anchor=\"end\">", escaped(chart.high),
                      "</text>\n<text x=\"", margin, "\" y=\"", margin - 8, "\">", escaped(chart.top),
                      "</text>\n</svg>\n");
}

} // namespace vkt::render
