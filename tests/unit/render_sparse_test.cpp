// Pictures that leave out rays and steps, against those that draw all of them.
// SPDX-License-Identifier: MIT
#include "render_testing.h"

#include "libvkt/core/text.h"
#include "libvkt/render/colormap.h"

#include <cstdint>

namespace vkt::render::testing {
namespace {

/// Levels of 8-bit display over the background.
double greatest_level_difference(Image const& a, Image const& b, Background const& background) {
    double greatest = 0;
    for (std::size_t i = 0; i < a.pixels.size(); i += 4) {
        auto const one = over(&a.pixels[i], background), other = over(&b.pixels[i], background);
        for (std::size_t c = 0; c < 3; ++c) {
            auto const level = [](float v) {
                return 255 * linear_to_srgb(std::clamp(static_cast<double>(v), 0.0, 1.0));
            };
            greatest = std::max(greatest, std::abs(level(one[c]) - level(other[c])));
        }
    }
    return greatest;
}

double noise(std::int64_t x, std::int64_t y, std::int64_t z) {
    auto h = static_cast<std::uint64_t>(x * 73856093 ^ y * 19349663 ^ z * 83492791) * 0x9e3779b97f4a7c15U;
    h ^= h >> 29, h *= 0xbf58476d1ce4e5b9U;
    return static_cast<double>(h >> 40) * 0x1p-24;
}

constexpr std::int64_t n = 72;

/// 0 to 1: ripples in a ball, a ball with a hard edge and noise, a ball with a wire around it.
double field(char which, double x, double y, double z) {
    double const u = 2 * x / n - 1, v = 2 * y / n - 1, w = 2 * z / n - 1, r2 = u * u + v * v + w * w;
    if (which == 'r')
        return std::exp(-3 * r2) * (0.6 + 0.4 * std::cos(12 * u + 3 * v) * std::cos(11 * v - 2 * w) * std::cos(10 * w));
    if (which == 'n') return (r2 < 0.5 ? 0.6 : 0) + 0.1 * noise(std::llround(x), std::llround(y), std::llround(z));
    double const out = std::abs(u) - 0.7, up = w - 0.1;
    return std::max(0.8 * std::exp(-8 * r2), out * out + up * up < 0.0006 ? 1.0 : 0.0);
}

Volume scene_volume(char which, DataType type) {
    double const top = type == DataType::uint8 ? 255 : 1;
    Header header;
    header.dims = {n, n, n};
    header.dtype = type;
    Volume volume(header);
    auto const fill = [&](auto const& v) {
        for (std::int64_t z = 0; z < n; ++z)
            for (std::int64_t y = 0; y < n; ++y)
                for (std::int64_t x = 0; x < n; ++x)
                    v(x, y, z) = static_cast<std::remove_reference_t<decltype(v(0, 0, 0))>>(
                        top * field(which, static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)));
    };
    if (type == DataType::uint8)
        fill(volume.mutable_view().as<std::uint8_t>());
    else
        fill(volume.mutable_view().as<float>());
    return volume;
}

RenderSettings scene_settings(DataType type, bool dense, double shade) {
    double const top = type == DataType::uint8 ? 255 : 1;
    RenderSettings s;
    s.width = 250, s.height = 215; // no multiple of anything
    s.camera.view = "oblique";
    s.shade = shade;
    TransferFunction transfer;
    transfer.unit = 1;
    transfer.points =
        dense ? std::vector<ControlPoint>{{0, {}, 0}, {0.3 * top, {0.2, 0.5, 1}, 0}, {top, {1, 0.8, 0.3}, 0.5}}
              : std::vector<ControlPoint>{{0, {1, 1, 1}, 0}, {top, {1, 1, 1}, 0.05}};
    s.transfer = transfer;
    return s;
}

TEST(RenderSparse, WhatIsLeftOutIsBelowHalfALevel) {
    for (char const which : {'r', 'n', 'w'})
        for (DataType const type : {DataType::uint8, DataType::float32}) {
            Renderer const renderer(scene_volume(which, type), default_execution());
            for (bool const dense : {false, true})
                for (double const shade : {0.0, 0.8}) {
                    RenderSettings s = scene_settings(type, dense, shade);
                    RenderReport all, few;
                    Image const reference = renderer.render(s, &all);
                    s.shortcut = 0.5;
                    Image const image = renderer.render(s, &few);
                    std::string const what = std::string(1, which) + (dense ? " dense " : " fog ") + to_text(type) +
                                             (shade > 0 ? " shaded" : "");
                    EXPECT_LE(greatest_level_difference(image, reference, s.background), 0.5) << what;
                    // Corners twice and more is what it costs where nothing can be left out.
                    EXPECT_LT(few.samples, 1.25 * static_cast<double>(all.samples)) << what;
                    if (which == 'r' && !dense) {
                        EXPECT_LT(few.samples, 0.8 * static_cast<double>(all.samples)) << what;
                        EXPECT_GT(few.savings.longer, 0.3) << what;
                    }
                }
        }
}

TEST(RenderSparse, ThreadsAndPartsChangeNoBit) {
    Volume const volume = scene_volume('r', DataType::uint8);
    RenderSettings s = scene_settings(DataType::uint8, false, 0.8);
    s.shortcut = 0.5;
    Execution one = default_execution(), three = one;
    one.threads = 1, three.threads = 3;
    Image const whole = render::render(volume, s, one);
    EXPECT_EQ(render::render(volume, s, three).pixels, whole.pixels);
    std::vector<float> joined;
    s.parts = 5;
    for (s.part = 1; s.part <= s.parts; ++s.part) {
        Image const part = render::render(volume, s, three);
        joined.insert(joined.end(), part.pixels.begin(), part.pixels.end());
    }
    EXPECT_EQ(joined, whole.pixels);
}

TEST(RenderSparse, AllIsDrawnWhereLevelsAreNotWhatCounts) {
    Volume const volume = scene_volume('w', DataType::uint8);
    RenderSettings s = scene_settings(DataType::uint8, false, 0);
    auto const changes = [&] {
        s.shortcut = 0;
        Image const reference = render::render(volume, s, default_execution());
        s.shortcut = 0.5;
        return render::render(volume, s, default_execution()).pixels != reference.pixels;
    };
    EXPECT_TRUE(changes());
    s.background.alpha = 0; // colours are divided by what may be little
    EXPECT_FALSE(changes());
    s.background.alpha = 1;
    s.width = 3, s.height = 2; // no block
    EXPECT_FALSE(changes());
    s.width = 64, s.height = 64, s.exact = true;
    EXPECT_FALSE(changes());
}

} // namespace
} // namespace vkt::render::testing
