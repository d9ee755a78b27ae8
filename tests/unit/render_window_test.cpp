// What a window needs of the renderer: nothing made twice, passes that add up, clip boxes, surfaces that let light
// pass.
// SPDX-License-Identifier: MIT
#include "libvkt/render/settings.h"
#include "tests/unit/render_testing.h"

#include <cmath>

namespace vkt::render {
namespace {

using testing::blobs;
using testing::constant_volume;
using testing::flat_transfer;
using testing::orthographic;
using testing::render_one;
using testing::volume_of;

TEST(RenderPrepared, camerasChangeNothingThatWasMade) {
    Renderer const renderer(blobs({20, 16, 24}, DataType::uint8), {});
    RenderSettings s;
    s.width = s.height = 8;
    for (double const azimuth : {0.0, 30.0, 77.0}) {
        s.camera.azimuth = azimuth;
        renderer.render(s);
    }
    s.step = 1, s.width = 9, s.clip = {"2:9,:,:"};
    renderer.render(s);
    EXPECT_EQ(renderer.preparations(), 1);
    // And what is kept is not shown where it does not hold.
    std::vector<void (*)(RenderSettings&)> const changes{
        [](RenderSettings& t) { t.opacity = "0,0.3"; },
        [](RenderSettings& t) { t.domain = "20:90"; },
        [](RenderSettings& t) { t.colormap = "grey"; },
        [](RenderSettings& t) { t.opacity_scale = 3; },
        [](RenderSettings& t) { t.unit = "4"; },
        [](RenderSettings& t) { t.shade = 0.3; },
        [](RenderSettings& t) { t.lut = {1, 0, 0, 0, 0, 1, 0, 1}; },
        [](RenderSettings& t) {
            t.transfer = flat_transfer({0.2, 0.4, 0.6}, 0.1, 1);
        },
        [](RenderSettings& t) { t.algorithm = Algorithm::implicit_iso; },
        [](RenderSettings& t) {
            t.isos = {60, 120};
        },
        [](RenderSettings& t) { t.iso_colors = {1, 0, 0, 0, 1, 0}; },
        [](RenderSettings& t) {
            t.iso_opacities = {0.5, 1};
        }};
    std::int64_t made = 1;
    for (auto const change : changes) {
        change(s);
        Image const kept = renderer.render(s);
        EXPECT_EQ(renderer.preparations(), ++made);
        EXPECT_EQ(kept.pixels, Renderer(blobs({20, 16, 24}, DataType::uint8), {}).render(s).pixels) << made;
    }
}

TEST(RenderAccumulation, passesAddUpBitForBit) {
    Renderer const renderer(blobs({20, 16, 24}, DataType::uint8), {});
    RenderSettings s;
    s.algorithm = Algorithm::multi_scattering;
    s.width = 24, s.height = 20, s.samples = 13, s.first_sample = 5;
    Image const one = renderer.render(s);
    Accumulation accumulation;
    Image last;
    RenderReport report;
    for (int const samples : {1, 4, 8}) {
        s.samples = samples;
        last = renderer.render(s, &report, {}, &accumulation);
    }
    EXPECT_EQ(last.pixels, one.pixels);
    EXPECT_EQ(accumulation.samples, 13);
    EXPECT_NE(report.method.find("13 paths"), std::string::npos) << report.method;
}

TEST(RenderClip, aSlabIsAsThickAsTheBoxLeavesIt) {
    Volume const volume = constant_volume({8, 8, 10}, 1, {1, 1, 2});
    RenderSettings s = orthographic("x", 5, 5);
    s.transfer = flat_transfer({1, 1, 1}, 0.2, 1);
    for (auto const& [clip, thick] : {std::pair{"", 8.0}, {"2:5,:,:", 3.0}, {"7:8,1:7,:", 1.0}}) {
        s.clip = {clip};
        auto const picture = render_one(volume, s);
        EXPECT_NEAR(static_cast<double>(picture.center()[3]), std::pow(0.8, thick), 1e-6) << clip;
    }
    // Along z voxels are twice as thick.
    s.camera.view = "z";
    s.clip = {":,:,3:7"};
    EXPECT_NEAR(static_cast<double>(render_one(volume, s).center()[3]), std::pow(0.8, 8), 1e-6);
    s.clip = {":,:,3:11"};
    EXPECT_THROW(render_one(volume, s), Error);
}

TEST(RenderIso, surfacesThatLetLightPassAreLaidOverOneAnother) {
    // A ramp along z, seen from above: the greater value lies in front.
    Volume const volume = volume_of({6, 6, 12}, {1, 1, 1}, [](double, double, double z) { return z; });
    RenderSettings s = orthographic("z", 5, 5);
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {3, 8};
    s.iso_colors = {1, 0, 0, 0, 0, 1};
    s.iso_opacities = {0.5, 0.25};
    EXPECT_NEAR(render_one(volume, s).center()[2], 0.25, 1e-6); // blue in front
    EXPECT_NEAR(render_one(volume, s).center()[0], 0.75 * 0.5, 1e-6);
    EXPECT_NEAR(render_one(volume, s).center()[3], 0.75 * 0.5, 1e-6);
    // From below, red hides blue where it is opaque.
    s.camera.view = "-z";
    s.iso_opacities = {1, 0.25};
    auto const below = render_one(volume, s);
    EXPECT_NEAR(below.center()[0], 1, 1e-6);
    EXPECT_NEAR(below.center()[2], 0, 1e-6);
    EXPECT_NEAR(below.center()[3], 0, 1e-6);
    // Nothing is seen of a surface without opacity.
    s.iso_opacities = {0, 0};
    EXPECT_EQ(render_one(volume, s).center()[3], 1);
    s.iso_opacities = {0.5};
    EXPECT_THROW(render_one(volume, s), Error);
    s.iso_opacities = {0.5, 1.5};
    EXPECT_THROW(render_one(volume, s), Error);
}

TEST(RenderIso, aClosedSurfaceIsCrossedTwice) {
    Volume const volume = volume_of({17, 17, 17}, {1, 1, 1}, [](double x, double y, double z) {
        return 6 - std::sqrt((x - 8) * (x - 8) + (y - 8) * (y - 8) + (z - 8) * (z - 8));
    });
    RenderSettings s = orthographic("x", 5, 5);
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {0.5};
    s.iso_opacities = {0.3};
    EXPECT_NEAR(static_cast<double>(render_one(volume, s).center()[3]), 0.7 * 0.7, 1e-6);
}

TEST(RenderValues, areThoseOfTheVoxels) {
    for (DataType const type : {DataType::uint8, DataType::int16, DataType::float32, DataType::float64}) {
        Volume volume = blobs({9, 7, 5}, type);
        volume.header().values = {2, -3};
        Renderer const renderer(volume, {});
        for (Index3 const at : {Index3{0, 0, 0}, Index3{3, 2, 1}, Index3{8, 6, 4}}) {
            double stored = 0;
            ConstView const view = static_cast<Volume const&>(volume).view();
            if (type == DataType::uint8) stored = view.as<std::uint8_t>()(at.x, at.y, at.z);
            if (type == DataType::int16) stored = view.as<std::int16_t>()(at.x, at.y, at.z);
            if (type == DataType::float32) stored = static_cast<double>(view.as<float>()(at.x, at.y, at.z));
            if (type == DataType::float64) stored = view.as<double>()(at.x, at.y, at.z);
            Vec3 const index{static_cast<double>(at.x) + 0.4, static_cast<double>(at.y) - 0.4,
                             static_cast<double>(at.z)};
            EXPECT_NEAR(renderer.value_at(index), 2 * stored - 3, 1e-4);
        }
        EXPECT_TRUE(std::isnan(renderer.value_at({9, 0, 0})));
        EXPECT_TRUE(std::isnan(renderer.value_at({-0.6, 0, 0})));
        EXPECT_TRUE(std::isnan(renderer.value_at({std::nan(""), 0, 0})));
    }
}

} // namespace
} // namespace vkt::render
