// Smooth edges of surfaces against pictures of many rays; memory that is asked for in pieces.
// SPDX-License-Identifier: MIT
#include "render_trees.h"

#include "libvkt/render/levels.h"
#include "libvkt/render/passes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <unistd.h>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

/// A ball before a slanted box: surfaces that end before the background, and one before another.
Volume ball_and_box() {
    return volume_of({48, 48, 48}, {1, 1, 1}, [](double x, double y, double z) {
        double const ball = 10 - std::hypot(x - 17, y - 14, z - 27);
        double const a = std::abs(0.8 * (x - 27) + 0.6 * (y - 30)), b = std::abs(0.8 * (y - 30) - 0.6 * (x - 27));
        return std::max(ball, 11 - std::max({a, b, std::abs(z - 22)}));
    });
}

RenderSettings surface(int side) {
    RenderSettings s;
    s.algorithm = Algorithm::implicit_iso;
    s.tree = TreeDrawing::bricks;
    s.isos = {0};
    s.iso_colors = {1, 0.8, 0.5};
    s.width = s.height = side;
    return s;
}

/// What 4 x 4 rays a pixel, evenly spread, see.
Image supersampled(Volume const& volume, RenderSettings s) {
    int const side = s.width;
    s.edge_rays = 1;
    s.width *= 4, s.height *= 4;
    Image const large = render_one(volume, s).image;
    Image mean{side, side, std::vector<float>(4 * static_cast<std::size_t>(side) * static_cast<std::size_t>(side))};
    for (int y = 0; y < large.height; ++y)
        for (int x = 0; x < large.width; ++x)
            for (std::size_t c = 0; c < 4; ++c)
                mean.pixels[4 * static_cast<std::size_t>(y / 4 * side + x / 4) + c] += large.at(x, y)[c] / 16;
    return mean;
}

struct Apart {
    double rms, worst;
};
/// In levels of 8-bit display.
Apart error_of(Image const& image, Image const& reference) {
    Levels const levels{Background{}};
    double sum = 0, worst = 0;
    std::size_t const count = image.pixels.size() / 4;
    for (std::size_t i = 0; i < count; ++i) {
        double const apart = levels.apart(&image.pixels[4 * i], &reference.pixels[4 * i]);
        sum += apart * apart, worst = std::max(worst, apart);
    }
    return {std::sqrt(sum / static_cast<double>(count)), worst};
}

} // namespace

TEST(RenderEdges, AreSmoothUnlessTheyAreNotToBe) {
    Volume const grid = ball_and_box();
    Volume const tree = cut<float>(grid, {16, 16, 16});
    for (Volume const* volume : {&grid, &tree}) {
        RenderSettings s = surface(96);
        Image const reference = supersampled(*volume, s);
        Picture const smooth = render_one(*volume, s);
        s.edge_rays = 1;
        Picture const plain = render_one(*volume, s);
        Apart const before = error_of(plain.image, reference), after = error_of(smooth.image, reference);
        RecordProperty("rms", std::to_string(before.rms) + " " + std::to_string(after.rms));
        EXPECT_GT(before.worst, 80);
        EXPECT_LT(after.worst, 0.8 * before.worst);
        EXPECT_LT(after.rms, before.rms / 2);
        // A few of the pixels, and of the others not a bit.
        EXPECT_GT(smooth.report.quality.edges, 0.02);
        EXPECT_LT(smooth.report.quality.edges, 0.15);
        EXPECT_EQ(plain.report.quality.edges, 0);
        std::size_t same = 0;
        for (std::size_t i = 0; i < plain.image.pixels.size(); i += 4)
            same += std::equal(&plain.image.pixels[i], &plain.image.pixels[i] + 4, &smooth.image.pixels[i]) ? 1 : 0;
        EXPECT_GE(static_cast<double>(same), (1 - smooth.report.quality.edges) * 96 * 96 - 0.5);
        // More rays are nearer.
        s.edge_rays = 64;
        Apart const many = error_of(render_one(*volume, s).image, reference);
        EXPECT_LT(many.rms, before.rms / 4);
        EXPECT_LT(many.rms, after.rms);
    }
}

TEST(RenderEdges, ThreadsAndPartsChangeNoBit) {
    Volume const volume = ball_and_box();
    RenderSettings s = surface(80);
    Execution one, three;
    three.threads = 3;
    Image const whole = render::render(volume, s, one);
    EXPECT_EQ(whole.pixels, render::render(volume, s, three).pixels);
    std::vector<float> joined;
    s.parts = 5;
    for (s.part = 1; s.part <= s.parts; ++s.part) {
        Image const part = render::render(volume, s, one);
        joined.insert(joined.end(), part.pixels.begin(), part.pixels.end());
    }
    EXPECT_EQ(whole.pixels, joined);
}

TEST(RenderEdges, ATransparentBackgroundHasSmoothEdges) {
    RenderSettings s = surface(64);
    s.background.alpha = 0;
    s.background.color = {0.8, 0.66, 0.4}; // as bright as the surface
    Image const image = render_one(ball_and_box(), s).image;
    int partly = 0;
    for (std::size_t i = 3; i < image.pixels.size(); i += 4) partly += image.pixels[i] > 0 && image.pixels[i] < 1;
    EXPECT_GT(partly, 60);
}

TEST(RenderEdges, RaysThatAreNoPowerOfTwoAreRefused) {
    for (int const rays : {0, 3, 12, 2048, -8}) {
        RenderSettings s = surface(8);
        s.edge_rays = rays;
        EXPECT_THROW((void)render_one(ball_and_box(), s), Error) << rays;
    }
}

// Whoever asks the largest picture to stop is heard before its gigabytes are touched.
TEST(RenderRoom, AStopIsHeardWhileMemoryIsTouched) {
    auto const resident = [] {
        std::ifstream statm("/proc/self/statm");
        std::int64_t all = 0, there = 0;
        statm >> all >> there;
        return there * ::sysconf(_SC_PAGESIZE);
    };
    Renderer const renderer(constant_volume({4, 4, 4}, 1.0F, {1, 1, 1}), {});
    for (Algorithm const algorithm : {Algorithm::ray_marching, Algorithm::multi_scattering}) {
        RenderSettings s;
        s.algorithm = algorithm;
        s.width = s.height = 16384; // 4 GiB
        std::int64_t const before = resident();
        std::int64_t most = 0;
        RenderReport report;
        Watch watch;
        watch.stop = [&] {
            most = std::max(most, resident() - before);
            return true;
        };
        Image const image = renderer.watched(s, &report, watch);
        EXPECT_TRUE(image.pixels.empty());
        EXPECT_TRUE(report.quality.stopped);
        EXPECT_EQ(report.quality.undrawn, 1);
        EXPECT_GT(most, 0);
        EXPECT_LT(most, std::int64_t{512} << 20);
    }
}
