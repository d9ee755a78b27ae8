// Labels as categories: colours that are those of labels and nothing between, edges where voxels end, light, refusals.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/formats/labels.h"
#include "tests/unit/render_testing.h"

#include <numbers>
#include <set>

namespace vkt::render {
namespace {

using namespace testing;

/// Labels by voxel in a type, with the attribute that says so.
template <class T, class F> Volume labels_of(Index3 dims, DataType type, F f) {
    Header header;
    header.dims = dims;
    header.dtype = type;
    header.attributes[meaning_key] = labels_meaning;
    Volume volume(header);
    auto const v = volume.mutable_view().as<T>();
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x) v(x, y, z) = static_cast<T>(f(x, y, z));
    return volume;
}

/// A box of 16 voxels a side in 24, whose left half is label 1 and whose right half is label 2.
Volume halves() {
    return labels_of<std::uint8_t>({24, 24, 24}, DataType::uint8, [](auto x, auto y, auto z) {
        bool const inside = std::min({x, y, z}) >= 4 && std::max({x, y, z}) < 20;
        return !inside ? 0 : x < 12 ? 1 : 2;
    });
}

std::array<float, 3> linear(std::int64_t label) {
    auto const color = label_color(label);
    std::array<float, 3> light{};
    for (std::size_t c = 0; c < 3; ++c) light[c] = static_cast<float>(srgb_to_linear(color[c]));
    return light;
}

/// From -y, four pixels a voxel: column and row 4k … 4k + 3 are voxel k of x, and of z from above.
RenderSettings from_front() {
    RenderSettings s = orthographic("-y", 96, 96);
    s.camera.span = 24;
    s.camera.fit = Fit::volume;
    return s;
}

TEST(RenderLabels, everyPixelIsALabelOrNothing) {
    Picture const picture = render_one(halves(), from_front());
    ASSERT_NE(picture.report.labels, nullptr);
    ASSERT_EQ(picture.report.labels->size(), 2U);
    for (int y = 0; y < 96; ++y)
        for (int x = 0; x < 96; ++x) {
            bool const inside = std::min(x, y) >= 16 && std::max(x, y) < 80;
            std::array<float, 3> const want = inside ? linear(x < 48 ? 1 : 2) : std::array<float, 3>{0, 0, 0};
            float const* p = picture.image.at(x, y);
            for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(p[c], want[c]) << x << ", " << y;
            EXPECT_EQ(p[3], inside ? 0.0F : 1.0F) << x << ", " << y;
        }
}

TEST(RenderLabels, aWallThatFacesTheEyeIsLitInFull) {
    RenderSettings s = from_front();
    s.shade = 1;
    Picture const picture = render_one(halves(), s);
    // Further from its edges than light is smoothed: three voxels.
    for (int y = 29; y < 67; ++y)
        for (int x = 29; x < 67; ++x)
            for (std::size_t c = 0; c < 3; ++c)
                EXPECT_NEAR(picture.image.at(x, y)[c], linear(x < 48 ? 1 : 2)[c] + 0.12F, 2e-6F) << x << ", " << y;
}

TEST(RenderLabels, aCutShowsTheLabelsInIt) {
    RenderSettings s = from_front();
    s.shade = 1;
    s.specular = 0;
    s.clip.text = ":,12:,:";
    Picture const picture = render_one(halves(), s);
    for (int y = 16; y < 80; ++y)
        for (int x = 16; x < 80; ++x)
            for (std::size_t c = 0; c < 3; ++c)
                EXPECT_NEAR(picture.image.at(x, y)[c], linear(x < 48 ? 1 : 2)[c], 2e-6F) << x << ", " << y;
}

TEST(RenderLabels, leavingOutEmptySpaceChangesNoBit) {
    auto const shells = [](auto x, auto y, auto z) {
        double const r =
            std::hypot(static_cast<double>(x) - 31, static_cast<double>(y) - 20, static_cast<double>(z) - 9);
        return r > 9 ? 0 : static_cast<int>(r);
    };
    Volume const small = labels_of<std::uint8_t>({61, 45, 33}, DataType::uint8, shells);
    Volume const wide = labels_of<std::int32_t>({61, 45, 33}, DataType::int32,
                                                [&](auto x, auto y, auto z) { return -1000 * shells(x, y, z); });
    for (Volume const* volume : {&small, &wide}) {
        RenderSettings s;
        s.width = s.height = 70;
        expect_no_bit_changes(*volume, s, "at the eye");
        s.light_direction = Vec3{1, -2, 3};
        s.shadows = true;
        s.ambient_occlusion = 8;
        Skipping const reports = expect_no_bit_changes(*volume, s, "lit");
        EXPECT_LT(reports.with.samples, reports.without.samples / 2);
        EXPECT_EQ(reports.with.labels->size(), 9U);
    }
    // The least value first.
    EXPECT_EQ(render_one(wide, from_front()).report.labels->front().label, -9000);
}

TEST(RenderLabels, normalsOfABallPointOutwards) {
    Vec3 const spacing{1, 1, 2};
    Volume volume = labels_of<std::uint16_t>({64, 64, 32}, DataType::uint16, [&](auto x, auto y, auto z) {
        double const dx = static_cast<double>(x) - 31.5, dy = static_cast<double>(y) - 31.5,
                     dz = 2 * (static_cast<double>(z) - 15.5);
        return dx * dx + dy * dy + dz * dz < 24 * 24 ? 7 : 0;
    });
    Header header = volume.header();
    header.geometry.spacing = spacing;
    Volume ball(header);
    copy(volume.view(), ball.mutable_view());
    RenderSettings s = orthographic("-y", 64, 64);
    s.camera.span = 64;
    s.camera.fit = Fit::volume;
    s.layers = true;
    Picture const picture = render_one(ball, s);
    ASSERT_GE(picture.report.layers.size(), 4U);
    double sum = 0, worst = 0;
    int count = 0;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) {
            double const nx = (x - 31.5) / 24, nz = (31.5 - y) / 24, in = 1 - nx * nx - nz * nz;
            if (in < 0.2) continue;
            auto const i = static_cast<std::size_t>(64 * y + x);
            auto const part = [&](std::size_t layer) {
                return static_cast<double>(picture.report.layers[layer].values[i]);
            };
            double const cosine = part(1) * nx - part(2) * std::sqrt(in) + part(3) * nz;
            double const degrees = std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi;
            sum += degrees, worst = std::max(worst, degrees), ++count;
        }
    EXPECT_LT(sum / count, 5);
    EXPECT_LT(worst, 20);
}

TEST(RenderLabels, namesAndColoursAreThoseOfTheHeader) {
    Volume const volume = halves();
    Header header = volume.header();
    header.attributes = {{"Segment4_LabelValue", "2"}, {"Segment4_Name", "kidney"}, {"Segment4_Color", "0.25 0.5 1"}};
    Volume named(header);
    copy(volume.view(), named.mutable_view());
    RenderReport const report = render_one(named, from_front()).report;
    ASSERT_NE(report.labels, nullptr);
    EXPECT_EQ(report.labels->at(0).name, "");
    EXPECT_EQ(report.labels->at(1).name, "kidney");
    EXPECT_EQ(report.labels->at(1).label, 2);
    EXPECT_EQ(report.labels->at(1).color, (Color{0.25, 0.5, 1}));
}

TEST(RenderLabels, onlyWhereItHelps) {
    Volume const volume = halves();
    auto const drawn = [&](auto change) {
        RenderSettings s = from_front();
        change(s);
        return render_one(volume, s).report.labels != nullptr;
    };
    EXPECT_TRUE(drawn([](RenderSettings&) {}));
    EXPECT_TRUE(drawn([](RenderSettings& s) { s.algorithm = Algorithm::implicit_iso; }));
    EXPECT_FALSE(drawn([](RenderSettings& s) { s.labels = LabelMode::never; }));
    EXPECT_FALSE(drawn([](RenderSettings& s) { s.colormap = "viridis"; }));
    EXPECT_FALSE(drawn([](RenderSettings& s) { s.algorithm = Algorithm::maximum; }));
    EXPECT_FALSE(drawn([](RenderSettings& s) { s.algorithm = Algorithm::implicit_iso, s.isos = {0.5}; }));
    RenderSettings s = from_front();
    Volume const blob = blobs({20, 20, 20}, DataType::uint8);
    EXPECT_EQ(render_one(blob, s).report.labels, nullptr);
    s.labels = LabelMode::always;
    EXPECT_NE(render_one(blob, s).report.labels, nullptr);
    Volume const between = constant_volume({4, 4, 4}, 0.5F, {1, 1, 1});
    EXPECT_THROW(render_one(between, s), Error);
}

TEST(RenderLabels, hasNoTwoColoursAlikeAmongTheFirst) {
    std::set<std::array<double, 3>> colors;
    for (std::int64_t label = -100; label <= 100; ++label) {
        auto const color = label_color(label);
        for (double const c : color) EXPECT_TRUE(c >= 0 && c <= 1) << label;
        if (label >= 0) colors.insert(color);
        EXPECT_EQ(label_color(label), color);
    }
    EXPECT_EQ(colors.size(), 101U);
}

} // namespace
} // namespace vkt::render
