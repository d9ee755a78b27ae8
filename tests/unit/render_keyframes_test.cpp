// Ways of the camera: exact at the keys, and what the splines say between them.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/products.h"
#include "libvkt/render/keyframes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace vkt::render {
namespace {

constexpr double pi = std::numbers::pi;

CameraRequest key(Vec3 eye, Vec3 target, Vec3 up = {0, 0, 1}, double fov = 30) {
    CameraRequest camera;
    camera.eye = eye, camera.target = target, camera.up = up, camera.fov = fov;
    return camera;
}
CameraRequest on_circle(double angle, double radius) {
    return key({radius * std::cos(angle), radius * std::sin(angle), 0}, {0, 0, 0});
}
double distance(CameraRequest const& c) { return length(*c.eye - *c.target); }
void expect_near(Vec3 a, Vec3 b, double bound = 1e-12) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], bound) << i;
}

TEST(RenderKeyframes, keysAreMetBitForBit) {
    std::vector<CameraRequest> const keys{key({1.1, 2.3, 3.7}, {0.1, 0.2, 0.3}, {0.1, 0.2, 0.9}, 33.3),
                                          key({-4.1, 2.9, 1.3}, {1.1, 0.7, 0.3}),
                                          key({-4.1, -7.9, 1.3}, {1.1, 0.7, 0.9}, {0, 0.3, 1}, 12.1)};
    auto const same = [](CameraRequest const& a, CameraRequest const& b) {
        return *a.eye == *b.eye && *a.target == *b.target && *a.up == *b.up && a.fov == b.fov;
    };
    for (int const count : {3, 5, 15, 99}) {
        auto const path = camera_path(keys, count);
        ASSERT_EQ(path.size(), static_cast<std::size_t>(count));
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_TRUE(same(path[k * static_cast<std::size_t>(count - 1) / 2], keys[k])) << count;
    }
    EXPECT_TRUE(same(camera_path(keys, 1).front(), keys.front()));
    EXPECT_TRUE(same(camera_path({keys[1]}, 3)[2], keys[1]));
    // An even number leaves the middle one out, but not the ends.
    EXPECT_TRUE(same(camera_path(keys, 4)[3], keys[2]));
}

TEST(RenderKeyframes, twoKeysMakeAnEvenTurnAtOneDistance) {
    auto const path = camera_path({on_circle(0.2, 3), on_circle(0.2 + 2.6, 3)}, 27);
    for (std::size_t i = 0; i < path.size(); ++i) {
        double const angle = 0.2 + 0.1 * static_cast<double>(i);
        expect_near(*path[i].eye, {3 * std::cos(angle), 3 * std::sin(angle), 0});
        expect_near(*path[i].up, {0, 0, 1});
        EXPECT_NEAR(path[i].fov, 30, 1e-12);
    }
}

TEST(RenderKeyframes, distancesAndAnglesOfViewGrowByFactors) {
    auto const path =
        camera_path({key({8, 0, 0}, {0, 0, 0}, {0, 0, 1}, 20), key({2, 0, 0}, {0, 0, 0}, {0, 0, 1}, 80)}, 3);
    EXPECT_NEAR(distance(path[1]), 4, 1e-12);
    EXPECT_NEAR(std::pow(std::tan(path[1].fov * pi / 360), 2), std::tan(pi / 18) * std::tan(pi / 4.5), 1e-12);
    auto flat = std::vector{key({8, 0, 0}, {0, 0, 0}), key({2, 0, 0}, {0, 0, 0})};
    for (CameraRequest& camera : flat) camera.projection = Projection::orthographic;
    flat[0].span = 10, flat[1].span = 1000;
    auto const spans = camera_path(flat, 3);
    EXPECT_NEAR(*spans[1].span, 100, 1e-9);
    EXPECT_EQ(spans[1].projection, Projection::orthographic);
}

TEST(RenderKeyframes, targetsFollowCatmullAndRom) {
    std::vector<Vec3> const targets{{0, 0, 0}, {1, 2, 0}, {3, 1, 1}, {4, 4, 4}};
    std::vector<CameraRequest> keys;
    keys.reserve(targets.size());
    for (Vec3 const t : targets) keys.push_back(key(t + Vec3{5, 0, 0}, t));
    auto const path = camera_path(keys, 31);
    for (std::size_t i = 0; i < path.size(); ++i) {
        std::size_t const k = std::min<std::size_t>(i / 10, 2);
        double const t = (static_cast<double>(i) - 10.0 * static_cast<double>(k)) / 10;
        // The matrix of their paper; beyond the ends straight on.
        Vec3 const p1 = targets[k], p2 = targets[k + 1];
        Vec3 const p0 = k > 0 ? targets[k - 1] : p1 * 2 - p2, p3 = k < 2 ? targets[k + 2] : p2 * 2 - p1;
        Vec3 const want = (p1 * 2 + (p2 - p0) * t + (p0 * 2 - p1 * 5 + p2 * 4 - p3) * (t * t) +
                           (p1 * 3 - p0 - p2 * 3 + p3) * (t * t * t)) *
                          0.5;
        expect_near(*path[i].target, want);
        expect_near(*path[i].eye, want + Vec3{5, 0, 0}); // looked at from the same side all the way
    }
}

TEST(RenderKeyframes, turnsHaveNoKinks) {
    // Turns about several axes: the way from picture to picture changes little, at the keys as well.
    std::vector<CameraRequest> const keys{key({5, 0, 0}, {0, 0, 0}), key({0, 5, 1}, {0, 0, 0}),
                                          key({-2, 3, 4}, {0, 0, 0}, {1, 0, 1}), key({-4, -3, 0}, {0, 0, 0})};
    constexpr int each = 200;
    auto const path = camera_path(keys, 3 * each + 1);
    auto const step = [&](std::size_t i) { return unit(*path[i + 1].eye) - unit(*path[i].eye); };
    for (std::size_t k = 1; k < 3; ++k)
        EXPECT_LT(length(step(k * each) - step(k * each - 1)), 0.05 * length(step(k * each)));
    for (auto const& camera : path) {
        EXPECT_NEAR(length(*camera.up) < 1.5, true, 0);
        EXPECT_NEAR(distance(camera), std::sqrt(26), 0.6);
    }
}

TEST(RenderKeyframes, theShortWayAround) {
    // From 170 to 190 degrees, not through 0.
    auto const path = camera_path({on_circle(170 * pi / 180, 1), on_circle(190 * pi / 180, 1)}, 3);
    expect_near(*path[1].eye, {-1, 0, 0});
}

TEST(RenderKeyframes, malformedListsAreRefused) {
    auto const keys = keyframes_from_json(R"([{"eye": [1, 2, 3], "target": [0, 0, 0], "fov": 12.5}])");
    ASSERT_EQ(keys.size(), 1U);
    EXPECT_EQ(keys[0].eye, (Vec3{1, 2, 3}));
    EXPECT_EQ(keys[0].fov, 12.5);
    EXPECT_FALSE(keys[0].up);
    for (char const* const json :
         {"", "{", "[]", "{}", "3", "[3]", "[{}]", R"([{"eye": [1, 2, 3]}])",
          R"([{"eye": [1, 2], "target": [0, 0, 0]}])", R"([{"eye": [1, 2, "x"], "target": [0, 0, 0]}])",
          R"([{"eye": [0, 0, 0], "target": [0, 0, 0]}])", R"([{"eye": [0, 0, 3], "target": [0, 0, 0]}])",
          R"([{"eye": [1, 2, 3], "target": [0, 0, 0], "fov": 180}])",
          R"([{"eye": [1, 2, 3], "target": [0, 0, 0], "span": 0}])",
          R"([{"eye": [1, 2, 3], "target": [0, 0, 0], "span": 2, "fov": 30}])",
          R"([{"eye": [1, 2, 3], "target": [0, 0, 0], "zoom": 2}])",
          R"([{"eye": [1, 2, 3], "target": [0, 0, 0]}, {"eye": [1, 2, 3], "target": [0, 0, 0], "span": 3}])"})
        EXPECT_THROW(keyframes_from_json(json), Error) << json;
}

} // namespace
} // namespace vkt::render
