// CT is recognised by its header or its values, and nothing is taken for it that may be something else.
// SPDX-License-Identifier: MIT
#include "render_testing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

Volume integers(std::function<double(double x, double y, double z)> const& value) {
    Header header;
    header.dims = {48, 48, 48};
    header.dtype = DataType::int16;
    Volume volume(header);
    auto const v = volume.mutable_view().as<std::int16_t>();
    for (std::int64_t z = 0; z < 48; ++z)
        for (std::int64_t y = 0; y < 48; ++y)
            for (std::int64_t x = 0; x < 48; ++x)
                v(x, y, z) = static_cast<std::int16_t>(std::lround(
                    value(static_cast<double>(x) / 47, static_cast<double>(y) / 47, static_cast<double>(z) / 47)));
    return volume;
}

/// Noise of a scanner, the same for every run.
double noise(double sigma) {
    static std::mt19937 random(7);
    double sum = 0;
    for (int i = 0; i < 4; ++i) sum += static_cast<double>(random()) / 4294967296.0 - 0.5;
    return sum * sigma * 1.7;
}

/// A cylinder of soft tissue around bone, in air.
double body(double x, double y, double) {
    double const r = std::hypot(x - 0.5, y - 0.5);
    double const hu = r < 0.08 ? 900 : r < 0.35 ? 40 : -1000;
    return std::max(-1024.0, hu + noise(15));
}

Volume with_units(Volume const& volume, std::string const& units) {
    Header header = volume.header();
    header.units = units;
    Volume other(header);
    std::memcpy(other.buffer().write(Space::host), volume.buffer().read(Space::host),
                static_cast<std::size_t>(header.bytes()));
    return other;
}

Picture drawn(
    Volume const& volume, std::function<void(RenderSettings&)> const& set = [](RenderSettings&) {}) {
    RenderSettings s;
    s.width = s.height = 24;
    set(s);
    return render_one(volume, s);
}

} // namespace

TEST(RenderRecognise, CtIsDrawnAsThePresetDraws) {
    Volume const ct = integers(body);
    Picture const automatic = drawn(ct), preset = drawn(ct, [](RenderSettings&s) { s.preset = DataKind::ct; });
    EXPECT_EQ(automatic.image.pixels, preset.image.pixels);
    EXPECT_NE(automatic.report.recognised.find("CT in HU"), std::string::npos) << automatic.report.recognised;
    EXPECT_TRUE(preset.report.recognised.empty());
    // Another span of values, or opacities, are what is asked for.
    EXPECT_TRUE(drawn(ct, [](RenderSettings& s) { s.domain = "minmax"; }).report.recognised.empty());
    EXPECT_TRUE(drawn(ct, [](RenderSettings& s) { s.opacity = "0,0.5"; }).report.recognised.empty());
    EXPECT_TRUE(drawn(ct, [](RenderSettings& s) { s.algorithm = Algorithm::implicit_iso; }).report.recognised.empty());
    // Other colours are.
    Picture const coloured = drawn(ct, [](RenderSettings& s) { s.colormap = "viridis"; });
    EXPECT_FALSE(coloured.report.recognised.empty());
    EXPECT_EQ(coloured.image.pixels,
              drawn(ct, [](RenderSettings& s) { s.preset = DataKind::ct, s.colormap = "viridis"; }).image.pixels);
}

TEST(RenderRecognise, HeadersThatSayHuAreBelieved) {
    // Nothing but tissue, which values alone do not tell.
    Volume const tissue = integers([](double x, double, double) { return 20 + 60 * x + noise(10); });
    EXPECT_TRUE(drawn(tissue).report.recognised.empty());
    EXPECT_NE(drawn(with_units(tissue, "HU")).report.recognised.find("header says HU"), std::string::npos);
    EXPECT_TRUE(drawn(with_units(tissue, "mT")).report.recognised.empty());
    EXPECT_TRUE(drawn(with_units(integers(body), "K")).report.recognised.empty());
    // Nothing is hidden for it: of air alone the preset shows nothing.
    Volume const air = integers([](double x, double, double) { return -1000 + 100 * x; });
    EXPECT_TRUE(drawn(with_units(air, "HU")).report.recognised.empty());
}

TEST(RenderRecognise, WhatMayBeSomethingElseIsLeftAlone) {
    auto const left = [](std::function<double(double, double, double)> const& value) {
        return drawn(integers(value)).report.recognised;
    };
    // A ramp, noise, waves about zero, counts from 0 on, and CT with an offset or another scale.
    EXPECT_EQ(left([](double x, double, double) { return -1000 + 4000 * x; }), "");
    EXPECT_EQ(left([](double, double, double) { return std::clamp(noise(2000), -1024.0, 3000.0); }), "");
    EXPECT_EQ(left([](double x, double y, double z) { return 1000 * std::sin(20 * x + 10 * y + 5 * z); }), "");
    EXPECT_EQ(left([](double x, double y, double z) { return body(x, y, z) + 1024; }), "");
    EXPECT_EQ(left([](double x, double y, double z) { return 10 * body(x, y, z); }), "");
    EXPECT_EQ(left([](double x, double y, double z) { return body(x, y, z) / 10; }), "");
    // Two values: a mask.
    EXPECT_EQ(left([](double x, double, double) { return x > 0.5 ? 0 : -1000; }), "");
    // The same in floats, where -1000 may be anything.
    Volume const floats =
        volume_of({48, 48, 48}, {1, 1, 1}, [](double x, double y, double z) { return body(x / 47, y / 47, z / 47); });
    EXPECT_EQ(drawn(floats).report.recognised, "");
}
