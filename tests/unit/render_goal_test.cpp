// Pictures that stop when they are good enough: errors against references drawn another way, bits, stops.
// SPDX-License-Identifier: MIT
#include "libvkt/render/settings.h"
#include "tests/unit/render_testing.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

Background const black{{0, 0, 0}, 1};

double level(Image const& image, int x, int y, int c) {
    return 255 * linear_to_srgb(std::clamp(static_cast<double>(image.at(x, y)[c]), 0.0, 1.0));
}

/// A picture of `factor` times the size, each of whose pixels has one ray, averaged in linear light.
Image reduced(Image const& large, int factor) {
    Image image{large.width / factor, large.height / factor, {}};
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < 4; ++c) {
                double sum = 0;
                for (int v = 0; v < factor; ++v)
                    for (int u = 0; u < factor; ++u)
                        sum += static_cast<double>(large.at(factor * x + u, factor * y + v)[c]);
                image.pixels.push_back(static_cast<float>(sum / (factor * factor)));
            }
    return image;
}

struct Apart {
    double rms = 0, most = 0;
    int above = 0;
};
Apart apart(Image const& a, Image const& b, double limit) {
    Apart result;
    for (int y = 0; y < a.height; ++y)
        for (int x = 0; x < a.width; ++x) {
            double worst = 0;
            for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(level(a, x, y, c) - level(b, x, y, c)));
            result.rms += worst * worst / (a.width * a.height);
            result.most = std::max(result.most, worst);
            result.above += worst > limit ? 1 : 0;
        }
    result.rms = std::sqrt(result.rms);
    return result;
}

RenderSettings small(int size) {
    RenderSettings s;
    s.width = s.height = size;
    s.background = black;
    s.camera.fit = Fit::volume;
    s.domain = "0:200";
    s.opacity = "0,0.05,0.4";
    s.colormap = "grey";
    return s;
}

} // namespace

TEST(RenderGoal, ToleranceBoundsTheErrorOfEdges) {
    Volume const volume = blobs({20, 16, 24}, DataType::uint8);
    RenderSettings s = small(40);
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {60};
    s.edge_rays = 1;
    RenderSettings large = s;
    large.width = large.height = 40 * 32;
    Image const reference = reduced(render::render(volume, large, default_execution()), 32);
    Image const plain = render::render(volume, s, default_execution());
    EXPECT_GT(apart(plain, reference, 4).above, 30); // of 1600: the edges
    for (double const tolerance : {4.0, 1.0}) {
        s.goal.tolerance = tolerance;
        RenderReport report;
        Image const image = render::render(volume, s, default_execution(), &report);
        Apart const off = apart(image, reference, tolerance);
        EXPECT_LE(off.above, 8) << tolerance; // 0.5 %
        EXPECT_LT(off.most, 6 * tolerance);   // of the few that the estimate misses
        EXPECT_LT(off.rms, tolerance / 2);
        EXPECT_EQ(report.quality.above, 0);
        EXPECT_LE(report.quality.worst, tolerance);
        EXPECT_LT(report.quality.rays, tolerance < 2 ? 200 : 60); // most pixels need few
    }
}

TEST(RenderGoal, ToleranceShortensStepsWhereTheyMatter) {
    Volume const volume = blobs({20, 16, 24}, DataType::float32);
    RenderSettings s = small(32);
    s.opacity = "0,0,0.9,0,0.9,0.2"; // bends often
    s.shade = 0;
    RenderSettings large = s;
    large.exact = true;
    large.width = large.height = 32 * 16;
    Image const reference = reduced(render::render(volume, large, default_execution()), 16);
    s.step = 4;
    double const coarse = apart(render::render(volume, s, default_execution()), reference, 1).rms;
    s.goal.tolerance = 1;
    RenderReport report;
    Image const image = render::render(volume, s, default_execution(), &report);
    Apart const off = apart(image, reference, 1);
    EXPECT_GT(coarse, 3);
    EXPECT_LE(off.above, 10);
    EXPECT_LT(off.rms, 0.5);
    EXPECT_LT(report.quality.finest, 4);
}

TEST(RenderGoal, NoiseIsWhatIsAskedForAndTheMeanStays) {
    Volume const volume = blobs({20, 16, 24}, DataType::uint8);
    RenderSettings s = small(48);
    s.algorithm = Algorithm::multi_scattering;
    s.albedo = 0.8;
    s.samples = 1 << 14;
    RenderSettings other = s;
    other.samples = 2048;
    other.seed = 99;
    Image const reference = render::render(volume, other, default_execution());
    s.goal.noise = 4;
    RenderReport report;
    Image const image = render::render(volume, s, default_execution(), &report);
    EXPECT_GT(report.quality.rays, 16);
    EXPECT_EQ(report.quality.above, 0);
    // Each tile, against what it was estimated for.
    double mean = 0, variance = 0;
    for (int y = 0; y < 48; y += 16)
        for (int x = 0; x < 48; x += 16) {
            double squares = 0;
            for (int v = y; v < y + 16; ++v)
                for (int u = x; u < x + 16; ++u) {
                    double worst = 0;
                    for (int c = 0; c < 3; ++c)
                        worst = std::max(worst, std::abs(level(image, u, v, c) - level(reference, u, v, c)));
                    squares += worst * worst / 256;
                    double const off =
                        static_cast<double>(image.at(u, v)[1]) - static_cast<double>(reference.at(u, v)[1]);
                    mean += off;
                    variance += off * off;
                }
            EXPECT_LT(std::sqrt(squares), 1.3 * s.goal.noise) << x << ' ' << y;
        }
    EXPECT_LT(std::abs(mean), 4 * std::sqrt(variance)); // a sum of independent differences
    // It does not depend on threads.
    Execution one = default_execution(), three = one;
    one.threads = 1, three.threads = 3;
    EXPECT_EQ(render::render(volume, s, one).pixels, render::render(volume, s, three).pixels);
}

TEST(RenderGoal, WatchedPicturesHaveTheBitsOfOthers) {
    Volume const volume = blobs({20, 16, 24}, DataType::uint8);
    Renderer const renderer(volume, default_execution());
    for (Algorithm const a : {Algorithm::ray_marching, Algorithm::implicit_iso, Algorithm::multi_scattering}) {
        RenderSettings s = small(40);
        s.algorithm = a;
        s.samples = 7;
        RenderReport one, two;
        EXPECT_EQ(renderer.render(s, &one).pixels, renderer.watched(s, &two, {}).pixels) << enum_name(a);
        EXPECT_EQ(one.method, two.method);
        EXPECT_EQ(one.samples, two.samples);
    }
}

TEST(RenderGoal, StoppedPicturesAreWhatThereIs) {
    Volume const volume = blobs({20, 16, 24}, DataType::uint8);
    Renderer const renderer(volume, default_execution());
    RenderSettings s = small(64);
    s.algorithm = Algorithm::multi_scattering;
    s.samples = 1 << 20;
    std::atomic<int> asked{0};
    Watch watch;
    watch.stop = [&] { return ++asked > 100; }; // 16 tiles a pass
    RenderReport report;
    Image const image = renderer.watched(s, &report, watch);
    EXPECT_TRUE(report.quality.stopped);
    EXPECT_EQ(report.quality.undrawn, 0);
    EXPECT_GT(report.quality.rays, 4);
    EXPECT_LT(report.quality.rays, 200);
    s.samples = 512;
    s.seed = 5;
    Apart const off = apart(image, renderer.render(s), 1);
    EXPECT_LT(off.rms, 60);
    EXPECT_GT(report.quality.error, off.rms / 2);
    EXPECT_LT(report.quality.error, off.rms * 2);
    // Nothing was drawn: background, and said.
    asked = 1000;
    Image const none = renderer.watched(s, &report, watch);
    EXPECT_EQ(report.quality.undrawn, 1);
    EXPECT_EQ(none.at(32, 32)[3], 1);
    EXPECT_NE(quality_text(report, {}).find("100% of the pixels not drawn"), std::string::npos);
}

TEST(RenderGoal, TimeEndsAPicture) {
    Volume const volume = blobs({20, 16, 24}, DataType::uint8);
    RenderSettings s = small(32);
    s.algorithm = Algorithm::multi_scattering;
    s.samples = 1 << 24;
    s.goal.seconds = 0.2;
    RenderReport report;
    (void)render::render(volume, s, default_execution(), &report);
    EXPECT_TRUE(report.quality.late);
    EXPECT_EQ(report.quality.undrawn, 0);
    EXPECT_GE(report.quality.rays, 1);
}
