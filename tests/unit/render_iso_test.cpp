// Iso-surfaces: planes and spheres in closed form, parity of crossings in noise, invariances, missing data.
// SPDX-License-Identifier: MIT
#include "libvkt/render/inner/iso.h"
#include "libvkt/render/screen.h"
#include "tests/unit/render_testing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

/// A volume as rays see it.
struct Setting {
    Lattice lattice;
    CellVisibility cells;
    SceneView scene{};
    LatticeSampler<float> sampler{};

    Setting(Volume const& volume, double iso) : lattice(make_lattice(volume.view(), {}, {})) {
        cells = classify_cells(lattice.cells, std::vector<IsoView>{{static_cast<float>(iso), 1, 1, 1}});
        scene.cells = view_of(lattice.cells, cells);
        scene.skip = true;
        sampler = {static_cast<float const*>(lattice.view.data), lattice.view.row, lattice.view.slice,
                   lattice.view.compact};
    }
    /// Crossings of the segment from a to b (voxel coordinates), as distances from a.
    std::vector<double> crossings(Double3 a, Double3 b, double iso) const {
        Double3 const way = b - a;
        double const length = std::sqrt(dot(way, way));
        Double3 const shift{lattice_padding, lattice_padding, lattice_padding};
        Ray const ray{a + shift, way * (1 / length), length, 1};
        std::vector<double> result;
        Counters counters;
        cross_ray(sampler, scene, ray, iso, counters, [&](double t, Side) {
            result.push_back(t);
            return true;
        });
        return result;
    }
    double value(Double3 p) const {
        Double3 const q = p + Double3{lattice_padding, lattice_padding, lattice_padding};
        int const x = static_cast<int>(q.x), y = static_cast<int>(q.y), z = static_cast<int>(q.z);
        float c[8];
        sampler.corners(x, y, z, c);
        double sum = 0;
        for (int k = 0; k < 8; ++k)
            sum += (1 - std::abs(q.x - x - (k & 1))) * (1 - std::abs(q.y - y - (k >> 1 & 1))) *
                   (1 - std::abs(q.z - z - (k >> 2))) * static_cast<double>(c[k]);
        return sum;
    }
};

} // namespace

TEST(RenderIso, PlaneIsMetExactly) {
    Double3 const n{0.48, 0.6, 0.64};
    Volume volume =
        volume_of({20, 31, 26}, {1, 1, 1}, [&](double x, double y, double z) { return n.x * x + n.y * y + n.z * z; });
    double const iso = 20.3;
    Setting const setting(volume, iso);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> share(0, 1);
    double worst = 0;
    int met = 0;
    for (int i = 0; i < 20000; ++i) {
        auto const point = [&] { return Double3{19 * share(random), 30 * share(random), 25 * share(random)}; };
        Double3 const a = point(), b = point();
        double const fa = dot(n, a) - iso, fb = dot(n, b) - iso;
        if (std::abs(fa - fb) < 1e-2 || std::abs(fa) < 1e-4 || std::abs(fb) < 1e-4) continue;
        auto const found = setting.crossings(a, b, iso);
        ASSERT_EQ(found.size(), (fa >= 0) != (fb >= 0) ? 1U : 0U);
        if (found.empty()) continue;
        ++met;
        Double3 const way = b - a;
        double const slope = (fb - fa) / std::sqrt(dot(way, way));
        worst = std::max(worst, std::abs(found.front() + fa / slope) * std::abs(slope)); // distance from the plane
    }
    EXPECT_GT(met, 1000);
    EXPECT_LT(worst, 1e-5);
}

// Distances of hits from a sphere fall with the square of the grid spacing.
TEST(RenderIso, SphereConvergesWithSecondOrder) {
    std::vector<double> errors;
    for (int const n : {16, 32, 64}) {
        double const centre = (n - 1) / 2.0, radius = 0.35 * n;
        Volume volume = volume_of({n, n, n}, {1, 1, 1}, [&](double x, double y, double z) {
            return std::sqrt((x - centre) * (x - centre) + (y - centre) * (y - centre) + (z - centre) * (z - centre));
        });
        Setting const setting(volume, radius);
        double sum = 0;
        int count = 0;
        for (int i = 0; i < 2000; ++i) {
            double const z = 1 - 2 * (i + 0.5) / 2000, angle = i * 2.399963, r = std::sqrt(1 - z * z);
            Double3 const c{centre, centre, centre},
                outer{centre + 0.45 * n * r * std::cos(angle), centre + 0.45 * n * r * std::sin(angle),
                      centre + 0.45 * n * z};
            auto const found = setting.crossings(outer, c, radius);
            ASSERT_EQ(found.size(), 1U);
            double const error = (0.45 * n - found.front() - radius) / n; // in units of the object
            sum += error * error;
            ++count;
        }
        errors.push_back(std::sqrt(sum / count));
    }
    EXPECT_NEAR(std::log2(errors[0] / errors[2]) / 2, 2.0, 0.2);
}

// Nothing leaks: the number of crossings is odd exactly if the ends lie on different sides, in white noise.
TEST(RenderIso, CrossingsHaveTheRightParityInNoise) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> share(0, 1);
    Volume noise = volume_of({19, 33, 26}, {1, 1, 1}, [&](double, double, double) { return share(random); });
    // Half of it is smooth, so that there are macrocells to skip.
    auto const v = noise.mutable_view().as<float>();
    for (std::int64_t z = 0; z < 26; ++z)
        for (std::int64_t y = 0; y < 17; ++y)
            for (std::int64_t x = 0; x < 19; ++x) v(x, y, z) = x < 10 ? 0.1F : 0.9F;
    std::int64_t total = 0;
    for (double const iso : {0.5, 0.9, 0.1}) { // the last ones are voxel values
        double const stored = static_cast<double>(static_cast<float>(iso));
        Setting const setting(noise, stored);
        for (int i = 0; i < 100000; ++i) {
            auto const point = [&] { return Double3{18 * share(random), 32 * share(random), 25 * share(random)}; };
            Double3 a = point(), b = point();
            if (i % 4 == 1) b.x = a.x, b.y = a.y;                                    // along an axis
            if (i % 4 == 2) a = {std::round(a.x), std::round(a.y), std::round(a.z)}; // from a voxel
            if (i % 4 == 3) b = {std::round(b.x), b.y, std::round(b.z)};
            auto const found = setting.crossings(a, b, stored);
            bool const differ = (setting.value(a) >= stored) != (setting.value(b) >= stored);
            // Ends that lie on the surface up to rounding may count either way.
            if (std::abs(setting.value(a) - stored) < 1e-9 || std::abs(setting.value(b) - stored) < 1e-9) continue;
            ASSERT_EQ(found.size() % 2 == 1, differ) << i << " " << iso;
            ASSERT_TRUE(std::is_sorted(found.begin(), found.end()));
            total += static_cast<std::int64_t>(found.size());
        }
    }
    EXPECT_GT(total, 100000);
}

// Cells with two and three roots against 4096 samples along the ray.
TEST(RenderIso, AllRootsOfRandomCellsAreFound) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> share(0, 1);
    int several = 0;
    for (int i = 0; i < 20000; ++i) {
        float v[8];
        for (float& c : v) c = static_cast<float>(share(random));
        Double3 const p{share(random), share(random), 0}, q{share(random), share(random), 1};
        Cubic const f = cubic_along(v, p, q - p);
        int brute = 0;
        bool above = f(0) >= 0.5;
        for (int k = 1; k <= 4096; ++k) {
            bool const here = f(k / 4096.0) >= 0.5;
            brute += here != above;
            above = here;
        }
        int found = 0;
        Side side = Side::unknown;
        cross_cell(f, 0.5, 0, 1, side, [&](Crossed const& crossed, Side) {
            EXPECT_NEAR(f(crossed.place()), 0.5, 1e-7);
            ++found;
            return true;
        });
        EXPECT_GE(found, brute);
        EXPECT_EQ(found % 2, brute % 2);
        several += brute > 1;
    }
    EXPECT_GT(several, 100);
}

TEST(RenderIso, SkippingAndSignChangeNothing) {
    Volume volume = blobs({40, 27, 33}, DataType::float32);
    RenderSettings s;
    s.algorithm = Algorithm::implicit_iso;
    s.width = 70, s.height = 60;
    s.isos = {60, 120};
    Picture const a = render_one(volume, s);
    s.skip = false;
    EXPECT_EQ(a.image.pixels, render_one(volume, s).image.pixels);
    s.isos = {1e6};
    EXPECT_EQ(render_one(volume, s).center()[3], 1);
}

TEST(RenderIso, SmallNumbersAreNoReasonToHit) {
    Volume volume = volume_of({16, 12, 14}, {1, 1, 1}, [](double x, double, double) { return 1e-9 * x; });
    RenderSettings s = orthographic("x", 9, 9);
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {1.001 * 15e-9};
    EXPECT_EQ(render_one(volume, s).center()[3], 1);
    s.isos = {7.3e-9};
    EXPECT_EQ(render_one(volume, s).center()[3], 0);
}

TEST(RenderIso, WhatNoSurfaceProjectsToIsLeftOutAndNothingElse) {
    // Specks, and a surface that reaches the border.
    Volume volume = volume_of({41, 52, 37}, {1, 0.5, 2}, [](double x, double y, double z) {
        auto const near = [&](double a, double b, double c) {
            return std::hypot(x - a, y - b, z - c) < 1.2 ? 1.0 : 0.0;
        };
        return near(7, 40, 9) + near(30, 11, 30) + near(21, 25, 19) + near(0, 0, 0) + near(40, 51, 36) +
               (x > 36 && y > 40 && z < 5 ? 0.9 : 0);
    });
    std::mt19937 random(5);
    std::uniform_real_distribution<double> share(-1, 1);
    for (int i = 0; i < 120; ++i) {
        RenderSettings s;
        s.algorithm = Algorithm::implicit_iso;
        s.isos = {0.5};
        s.width = 70 + i / 2, s.height = 90 - i / 2;
        double const far = i % 3 == 0 ? 20 : i % 3 == 1 ? 60 : 300; // within, close and far
        s.camera.eye = Vec3{20 + far * share(random), 12 + far * share(random), 36 + far * share(random)};
        s.camera.target = Vec3{20 + 15 * share(random), 12 + 10 * share(random), 36 + 20 * share(random)};
        if (i % 3 == 0) s.camera.fov = 120;
        if (i % 4 == 1) s.camera.projection = Projection::orthographic;
        if (i % 5 == 2) s.clip_planes = {1, 0.3, -0.2, 5};
        if (i % 7 == 3) s.clip.text = "3:35,5:45,2:33";
        if (i % 4 == 2) s.parts = 2, s.part = 1 + i % 3 / 2;
        Skipping const reports = expect_no_bit_changes(volume, s, "camera " + std::to_string(i));
        EXPECT_EQ(reports.with.rays, reports.without.rays) << i;
        s.algorithm = Algorithm::ray_marching;
        s.isos.clear();
        s.transfer = TransferFunction{};
        s.transfer->points = {{0.3, {1, 1, 1}, 0}, {0.5, {1, 1, 1}, 0.7}};
        Skipping const marched = expect_no_bit_changes(volume, s, "camera " + std::to_string(i) + ", marched");
        EXPECT_EQ(marched.with.rays, marched.without.rays) << i;
        EXPECT_EQ(marched.with.segments, marched.without.segments) << i;
    }
}

TEST(RenderIso, AWallBesideTheEyeIsSeenToTheEdge) {
    // Its cells are longer than wide, and reach behind the eye.
    Volume const volume = volume_of({40, 40, 40}, {0.5, 0.5, 4}, [](double, double y, double) { return 20.3 - y; });
    for (int i = 0; i < 40; ++i) {
        RenderSettings s;
        s.algorithm = Algorithm::implicit_iso;
        s.isos = {0};
        s.width = s.height = 64;
        double const y = 10.3 + 0.25 * i;
        s.camera.eye = Vec3{10, y, 70};
        s.camera.target = Vec3{10, y, 100};
        s.camera.up = Vec3{0, 1, 0};
        s.camera.fov = 60 + 3 * i;
        expect_no_bit_changes(volume, s, "eye at " + std::to_string(y));
    }
}

TEST(RenderIso, RaysGoWhereASurfaceMayBe) {
    Volume const volume = volume_of(
        {80, 80, 80}, {1, 1, 1}, [](double x, double y, double z) { return 10 - std::hypot(x - 40, y - 40, z - 40); });
    Lattice const lattice = make_lattice(volume.view(), {}, {});
    CellVisibility const cells = classify_cells(lattice.cells, std::vector<IsoView>{{0, 1, 1, 1}});
    SceneView scene{};
    scene.cells = view_of(lattice.cells, cells);
    scene.shown = {{2, 2, 2}, {82, 82, 82}, {}, 0};
    constexpr int width = 200, height = 160;
    auto const drawn = [&](Vec3 eye) {
        Camera camera;
        camera.eye = eye, camera.target = {40, 40, 40}, camera.up = {0, 0, 1}, camera.fov = 30;
        scene.frame = frame_of(camera, volume.header().geometry, lattice_padding, width, height);
        Screen const screen(scene, cells, 0, height, 2);
        std::vector<float> pixels(4 * width * height, 5);
        Counters counters;
        std::int64_t count = 0;
        bool middle = false;
        for (int y = 0; y < height; y += 16)
            for (int x = 0; x < width; x += 16)
                screen.draw(scene, false, {x, y, std::min(x + 16, width), std::min(y + 16, height)}, pixels.data(),
                            counters, [&](Tile t) {
                                count += (t.x1 - t.x0) * (t.y1 - t.y0);
                                middle = middle || (t.x0 <= 100 && t.x1 > 100 && t.y0 <= 80 && t.y1 > 80);
                            });
        EXPECT_TRUE(middle);
        std::int64_t left = 0;
        for (std::size_t i = 0; i < pixels.size(); i += 4) left += pixels[i] == 0 && pixels[i + 3] == 1 ? 1 : 0;
        EXPECT_EQ(count + left, width * height);
        return count;
    };
    // The ball's disc has 1200 pixels, and cells are 8 voxels wide.
    std::int64_t const outside = drawn({40, -160, 40});
    EXPECT_GT(outside, 1200);
    EXPECT_LT(outside, 6000);
    EXPECT_EQ(drawn({40, 36, 40}), width * height); // among the cells
}
