// Light and cuts: environments, shadows and ambient occlusion against closed forms, clip planes against clip boxes.
// SPDX-License-Identifier: MIT
#include "render_slab.h"
#include "render_trees.h"

#include "libvkt/render/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

/// One bright pixel.
std::shared_ptr<Environment const> patch(int width, int height, int column, int row, float radiance) {
    std::vector<float> pixels(static_cast<std::size_t>(3 * width) * static_cast<std::size_t>(height));
    for (std::size_t c = 0; c < 3; ++c)
        pixels[3 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                    static_cast<std::size_t>(column)) +
               c] = radiance;
    return make_environment(width, height, pixels);
}

} // namespace

TEST(RenderEnvironment, DirectionsMeetTheirPixels) {
    // 8 x 4: the middle columns 3 and 4 meet in the direction of +y, +x is where 5 and 6 meet.
    std::vector<float> pixels;
    for (int i = 0; i < 32; ++i) pixels.insert(pixels.end(), {static_cast<float>(i), 0, 1});
    auto const environment = make_environment(8, 4, pixels);
    auto const number = [&](double turned, Double3 way) {
        return static_cast<int>(light_from(environment->view(turned), way * (1 / std::sqrt(dot(way, way))))[0]);
    };
    EXPECT_EQ(number(0, {0.1, 1, 0.1}), 8 + 4);
    EXPECT_EQ(number(0, {-0.1, 1, -0.1}), 16 + 3);
    EXPECT_EQ(number(0, {1, 0.1, 0.1}), 8 + 5);
    EXPECT_EQ(number(0, {1, -0.1, 0.1}), 8 + 6);
    EXPECT_EQ(number(0, {-1, 0.1, 0.1}), 8 + 2);
    EXPECT_EQ(number(0, {0.1, -1, 0.1}), 8 + 7);
    EXPECT_EQ(number(0, {0.01, 0.02, 1}) / 8, 0);
    EXPECT_EQ(number(0, {0.01, 0.02, -1}) / 8, 3);
    // A quarter to the left, seen from above, brings what was in front (+y) to -x.
    EXPECT_EQ(number(90, {-1, 0.1, 0.1}), 8 + 4);
    EXPECT_EQ(number(-90, {1, -0.1, 0.1}), 8 + 4);
}

// Directions are drawn by brightness times solid angle, evenly over a pixel.
TEST(RenderEnvironment, DirectionsAreDrawnByBrightness) {
    std::vector<float> pixels;
    for (int i = 0; i < 6 * 5; ++i)
        for (int c = 0; c < 3; ++c) pixels.push_back(i % 4 == 1 ? 0.0F : static_cast<float>((i * 7) % 11 + c));
    auto const environment = make_environment(6, 5, pixels);
    EnvironmentView const view = environment->view(33);
    std::vector<double> found(30), wanted(30);
    constexpr int side = 60;
    double height = 0;
    for (int a = 0; a < side; ++a)
        for (int b = 0; b < side; ++b)
            for (int c = 0; c < 4; ++c)
                for (int d = 0; d < 4; ++d) {
                    auto const share = [](int i, int n) {
                        return (static_cast<float>(i) + 0.5F) / static_cast<float>(n);
                    };
                    SampledLight const light =
                        sampled_light(view, share(a, side), share(b, side), share(c, 4), share(d, 4));
                    ASSERT_NEAR(dot(light.direction, light.direction), 1, 1e-12);
                    ASSERT_EQ(light_from(view, light.direction), light.pixel);
                    found[static_cast<std::size_t>(light.pixel - view.pixels) / 3] += 1.0 / (side * side * 16);
                    height += light.direction.z / (side * side * 16);
                }
    double middle = 0;
    for (std::size_t i = 0; i < 30; ++i) {
        double const upper = std::cos(half_turn * static_cast<double>(i / 6) / 5),
                     lower = std::cos(half_turn * static_cast<double>(i / 6 + 1) / 5);
        double const likelihood = static_cast<double>(likelihood_of(view, view.pixels + 3 * i));
        wanted[i] = likelihood * 2 * half_turn / 6 * (upper - lower);
        middle += wanted[i] * (upper + lower) / 2;
        EXPECT_NEAR(found[i], wanted[i], 2.5 / side) << i;
    }
    EXPECT_NEAR(height, middle, 0.02);
}

TEST(RenderEnvironment, NumbersThatAreNoneAreRefused) {
    EXPECT_THROW((void)make_environment(1, 1, {1, std::numeric_limits<float>::infinity(), 0}), Error);
    EXPECT_THROW((void)make_environment(1, 1, {std::numeric_limits<float>::quiet_NaN(), 0, 0}), Error);
    EXPECT_EQ(make_environment(1, 1, {-1, 2, 0})->pixels[0], 0);
}

// The furnace: an environment that is 1 everywhere is light from all around.
TEST(RenderEnvironment, FurnaceIsOneOnGridsAndTrees) {
    Volume const grid = blobs({24, 18, 30}, DataType::float32);
    Volume const tree = small_tree();
    for (Volume const* volume : {&grid, &tree})
        for (double const anisotropy : {0.0, 0.7}) {
            RenderSettings s;
            s.width = s.height = 24;
            s.algorithm = Algorithm::multi_scattering;
            s.samples = 100;
            s.anisotropy = anisotropy;
            s.transfer = flat_transfer({1, 1, 1}, 0.3, 1);
            s.environment = make_environment(4, 2, std::vector<float>(24, 1.0F));
            Picture const picture = render_one(*volume, s);
            double met = 0, light = 0;
            for (std::size_t i = 0; i < picture.image.pixels.size(); i += 4) {
                met += 1 - static_cast<double>(picture.image.pixels[i + 3]);
                light += static_cast<double>(picture.image.pixels[i]);
            }
            ASSERT_GT(met, 50);
            // A path brings several parts with a mean of 1; their standard deviation is below 1.
            EXPECT_NEAR(light / met, 1, 4 / std::sqrt(100 * met)) << anisotropy;
            // Of light that depends on its strength nothing is lost: twice the light is twice as bright, bit for bit.
            s.environment_strength = 2;
            Picture const twice = render_one(*volume, s);
            for (std::size_t i = 0; i < twice.image.pixels.size(); i += 4)
                ASSERT_EQ(twice.image.pixels[i], 2 * picture.image.pixels[i]);
        }
}

// One bright patch, one scattering in a slab: the closed form, over the patch. As a directional light of its irradiance
// it is that but for the size of the patch.
TEST(RenderEnvironment, PatchAgreesWithALightFromThere) {
    constexpr int width = 32, height = 16, samples = 4000;
    for (int const row : {2, 5, 10})
        for (double const g : {0.0, 0.6}) {
            Slab slab(1.5, Algorithm::multi_scattering);
            RenderSettings& s = slab.settings;
            s.samples = samples;
            s.bounces = 2;
            s.albedo = 0.8;
            s.anisotropy = g;
            s.environment = patch(width, height, 5, row, 40);
            double wanted = 0, directional = 0;
            constexpr int parts = 400;
            double const upper = std::cos(half_turn * row / height), lower = std::cos(half_turn * (row + 1) / height);
            double const solid = 2 * half_turn / width * (upper - lower);
            auto const seen = [&](double cosine) {
                // Light comes down against `cosine` and goes up to the eye.
                double const phase = phase_of(g, -cosine);
                return 0.8 * 40 * solid * phase * once_scattered(1.5, cosine);
            };
            for (int i = 0; i < parts; ++i) wanted += seen(lower + (upper - lower) * (i + 0.5) / parts) / parts;
            directional = seen(std::cos(half_turn * (row + 0.5) / height));
            Picture const picture = render_one(slab.volume, s);
            double const found = mean_of_channel(picture.image, 0);
            // The light of a path lies between 0 and that of an unattenuated scattering, so that its variance is
            // bounded.
            double const most = 0.8 * 40 * solid * phase_of(g, -std::cos(half_turn * (row + 0.5) / height));
            EXPECT_NEAR(found, wanted, 4 * std::sqrt(wanted * 1.1 * most / (64.0 * samples))) << row << " " << g;
            EXPECT_NEAR(directional, wanted, 0.03 * wanted);
        }
}

TEST(RenderEnvironment, PassesAndThreadsChangeNoBit) {
    Volume const volume = blobs({24, 18, 30}, DataType::uint8);
    RenderSettings s;
    s.width = s.height = 20;
    s.algorithm = Algorithm::multi_scattering;
    s.environment = patch(16, 8, 3, 2, 20);
    s.samples = 7;
    Execution one, three;
    three.threads = 3;
    Image const all = render::render(volume, s, one);
    EXPECT_EQ(all.pixels, render::render(volume, s, three).pixels);
    Renderer const renderer(volume, one);
    Accumulation sums;
    s.samples = 3;
    (void)renderer.render(s, nullptr, {}, &sums);
    s.samples = 4;
    EXPECT_EQ(all.pixels, renderer.render(s, nullptr, {}, &sums).pixels);
    // Turned by a whole turn it is the same but for rounding, by half a turn another one.
    s.samples = 7;
    s.environment_rotation = 180;
    EXPECT_NE(all.pixels, render::render(volume, s, one).pixels);
}

// A homogeneous slab lit from one direction, of which what it holds back is missing: at any step, because segments are
// integrated.
TEST(RenderShadows, SlabIsTheClosedForm) {
    for (double const depth : {0.3, 2.0, 40.0})
        for (double const cosine : {1.0, 0.6, -0.8})
            for (double const step : {0.5, 4.0}) {
                Slab slab(depth, Algorithm::ray_marching);
                RenderSettings& s = slab.settings;
                s.light_direction = Vec3{std::sqrt(1 - cosine * cosine), 0, cosine};
                s.shadows = true;
                s.ambient = 0;
                s.step = step;
                double const wanted = once_scattered(depth, cosine);
                EXPECT_NEAR(static_cast<double>(render_one(slab.volume, s).center()[0]), wanted, 2e-5 + 1e-4 * wanted)
                    << depth << " " << cosine << " " << step;
                s.ambient = 0.25;
                double const all = -std::expm1(-depth);
                // A ray ends where less than 1/8100 of its light is left.
                EXPECT_NEAR(static_cast<double>(render_one(slab.volume, s).center()[0]), 0.25 * all + 0.75 * wanted,
                            1.3e-4);
            }
}

// What lies in the shadow of a slab gets exp(-tau) of the light that it gets without.
TEST(RenderShadows, ShadowOfASlabIsItsTransmittance) {
    // Below the slab lies a floor, which the camera sees from below; the lamp is above, at an angle.
    auto const scene = [](float slab) {
        return volume_of({120, 120, 40}, {1, 1, 1}, [=](double, double, double z) {
            return z < 6 ? 2.0F : z >= 20 && z < 30 ? slab : 0.0F;
        });
    };
    double const sigma = 0.05, cosine = 0.8;
    TransferFunction transfer;
    transfer.points = {{0, {1, 1, 1}, 0}, {1, {1, 1, 1}, -std::expm1(-sigma)}, {2, {1, 1, 1}, -std::expm1(-2 * sigma)}};
    transfer.linear_colors = true;
    transfer.unit = 1;
    RenderSettings s = orthographic("-z", 9, 9);
    s.camera.zoom = 20;
    s.transfer = transfer;
    s.light_direction = Vec3{0.6, 0, cosine};
    s.shadows = true;
    s.ambient = 0;
    // The slab itself is to be unseen: its own light is taken off.
    Volume const with = scene(1), without = scene(0);
    s.clip_planes = {0, 0, -1, -12}; // what is cut off throws no shadow
    double const cut = static_cast<double>(render_one(with, s).center()[0]);
    double const lit = static_cast<double>(render_one(without, s).center()[0]);
    EXPECT_NEAR(cut, lit, 1e-6 * lit);
    s.clip_planes.clear();
    double const passed = std::exp(-10 * sigma / cosine); // its ramps are as deep as what they replace
    double const floor_through = static_cast<double>(render_one(with, s).center()[3]);
    // Seen from below: the floor in the slab's shadow, then the slab through the floor.
    double const slab_alone = static_cast<double>(
        render_one(volume_of({120, 120, 40}, {1, 1, 1},
                             [](double, double, double z) { return z >= 20 && z < 30 ? 1.0F : 0.0F; }),
                   s)
            .center()[0]);
    double const floor_passes = floor_through / std::exp(-10 * sigma);
    double const found = static_cast<double>(render_one(with, s).center()[0]) - floor_passes * slab_alone;
    EXPECT_NEAR(found / lit, passed, 1e-3);
}

TEST(RenderShadows, SkippingThreadsAndInstructionsChangeNoBit) {
    for (DataType const type : {DataType::uint8, DataType::float32}) {
        Volume const volume = blobs({40, 27, 33}, type);
        RenderSettings s = colourful();
        s.light_direction = Vec3{1, -0.5, 0.7};
        s.shadows = true;
        s.shade = 0.7;
        s.ambient_occlusion = 8;
        expect_no_bit_changes(volume, s, to_text(type));
    }
    RenderSettings s = colourful();
    s.light_direction = Vec3{1, -0.5, 0.7};
    s.shadows = true;
    s.ambient_occlusion = 6;
    s.width = s.height = 24;
    expect_no_bit_changes(small_tree(), s, "tree");
}

// A tree of one level is the grid; one of several is near the grid of its finest cells.
TEST(RenderShadows, TreesAreLitAsGridsAre) {
    Volume const grid = blobs({40, 27, 33}, DataType::float32);
    RenderSettings s = colourful();
    s.light_direction = Vec3{1, -0.5, 0.7};
    s.shadows = true;
    s.ambient_occlusion = 12;
    s.shade = 0.5;
    Image const of_grid = render_one(grid, s).image;
    EXPECT_LT(greatest_difference(of_grid, render_one(cut<float>(grid, {16, 16, 16}), s).image), 2e-3);
    RenderSettings plain = s;
    plain.shadows = false, plain.ambient_occlusion = 0;
    EXPECT_GT(greatest_difference(of_grid, render_one(grid, plain).image), 0.05);
}

// Light from all around on a slab that scatters once: the mean over the directions in which it looks, of which each is
// a closed form, and with 64 of them within a hundredth of 0.248187, the integral for infinitely many.
TEST(RenderOcclusion, SlabIsTheMeanOfItsDirections) {
    for (int const directions : {8, 64}) {
        Slab slab(1, Algorithm::ray_marching);
        RenderSettings& s = slab.settings;
        s.ambient = 1;
        s.ambient_occlusion = directions;
        s.occlusion_radius = 1e4;
        double wanted = 0;
        for (int i = 0; i < directions; ++i) wanted += once_scattered(1, 1 - (2 * i + 1.0) / directions) / directions;
        double const found = static_cast<double>(render_one(slab.volume, s).center()[0]);
        EXPECT_NEAR(found, wanted, 1e-4);
        if (directions == 64) {
            EXPECT_NEAR(found, 0.248187, 2.5e-3);
        }
    }
}

namespace {

/// A floor at z = 8 and, at x = 8, a wall as high as the volume; both of large extent.
RenderSettings corner_view(Vec3 eye, Vec3 target) {
    RenderSettings s;
    s.width = s.height = 5;
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {0};
    s.iso_colors = {1, 1, 1};
    s.ambient = 1;
    s.specular = 0;
    s.ambient_occlusion = 64;
    s.occlusion_radius = 1e4;
    s.camera.projection = Projection::orthographic;
    s.camera.span = 0.01;
    s.camera.eye = eye, s.camera.target = target;
    return s;
}

} // namespace

TEST(RenderOcclusion, PlaneIsOpenAndACornerIsHalfClosed) {
    auto const floor = [](double, double, double z) { return 8 - z; };
    auto const corner = [](double x, double, double z) { return std::max(8 - z, 8 - x); };
    Index3 const dims{80, 320, 48};
    Volume const plane_volume = volume_of(dims, {1, 1, 1}, floor), corner_volume = volume_of(dims, {1, 1, 1}, corner);
    double const top = 47.5 - 8; // height of the wall
    for (double const away : {3.0, 6.0, 10.0, 20.0, 40.0}) {
        RenderSettings const s = corner_view({8 + away + 10, 170, 60}, {8 + away, 160, 8});
        EXPECT_EQ(render_one(plane_volume, s).center()[0], 1);
        // The directions, and which of them meet the wall.
        double open = 0, all = 0;
        for (int i = 0; i < 64; ++i) {
            double const z = 1 - (2 * i + 1.0) / 64, r = std::sqrt(1 - z * z), angle = i * 2.3999632297286533;
            if (z <= 0) continue;
            double const x = r * std::cos(angle), y = r * std::sin(angle), to_wall = away / -x;
            bool const met = x < 0 && z * to_wall < top && std::abs(y * to_wall) < 160;
            all += z;
            open += met ? 0 : z;
        }
        double const found = static_cast<double>(render_one(corner_volume, s).center()[0]);
        EXPECT_NEAR(found, open / all, 1e-3) << away;
        // The view factor of a long wall, which infinitely many directions give; each counts up to 1/16.
        EXPECT_NEAR(found, 1 - 0.5 * (1 - away / std::hypot(away, top)), 1.0 / 16) << away;
    }
    // What lies further than the radius does not count.
    RenderSettings s = corner_view({8 + 20 + 10, 170, 60}, {8 + 20, 160, 8});
    s.occlusion_radius = 15;
    EXPECT_EQ(render_one(corner_volume, s).center()[0], 1);
    // The same of a tree.
    s.occlusion_radius = 1e4;
    Picture const of_grid = render_one(corner_volume, s),
                  of_tree = render_one(cut<float>(corner_volume, {32, 32, 32}), s);
    EXPECT_NEAR(of_grid.center()[0], of_tree.center()[0], 1e-3);
}

TEST(RenderClipPlanes, AgreeWithClipBoxes) {
    for (bool const tree : {false, true}) {
        Volume const plain = with_geometry(blobs({40, 27, 33}, DataType::float32), skewed());
        Volume const volume = tree ? cut<float>(plain, {16, 16, 16}) : with_geometry(plain, skewed());
        Geometry const g = skewed();
        // Voxels from 12 on along x, and up to 19 along z.
        Vec3 const x = g.direction[0], z = g.direction[2];
        double const at_x = x.x * g.origin.x + x.y * g.origin.y + x.z * g.origin.z + 11.5 * g.spacing.x;
        double const at_z = z.x * g.origin.x + z.y * g.origin.y + z.z * g.origin.z + 19.5 * g.spacing.z;
        for (Algorithm const algorithm : {Algorithm::ray_marching, Algorithm::implicit_iso, Algorithm::multi_scattering,
                                          Algorithm::maximum, Algorithm::mean}) {
            RenderSettings s = colourful();
            s.algorithm = algorithm;
            if (algorithm == Algorithm::implicit_iso) s.isos = {60};
            s.samples = 4;
            s.edge_rays = 1; // or what falls to the other side spreads
            s.camera.eye = Vec3{160, -90, 90};
            s.camera.target = Vec3{105, 0, 30};
            RenderSettings boxed = s;
            boxed.clip.text = "12:,:,:20";
            // Lengths of normals do not matter.
            s.clip_planes = {3 * x.x, 3 * x.y, 3 * x.z, 3 * at_x, -z.x, -z.y, -z.z, -at_z};
            Image const a = render_one(volume, s).image, b = render_one(volume, boxed).image;
            EXPECT_GT(greatest_difference(a, render_one(volume,
                                                        [&] {
                                                            RenderSettings whole = s;
                                                            whole.clip_planes.clear();
                                                            return whole;
                                                        }())
                                                 .image),
                      0.02);
            // Rounding moves entries by an ulp; a few pixels at the rims of surfaces fall to the other side. In trees
            // gradients next to a face of the box are one-sided, and next to a plane they are not.
            std::size_t off = 0;
            for (std::size_t i = 0; i < a.pixels.size(); ++i) off += std::abs(a.pixels[i] - b.pixels[i]) > 2e-4F;
            EXPECT_LT(static_cast<double>(off), (tree ? 0.01 : 0.003) * static_cast<double>(a.pixels.size()))
                << enum_name(algorithm) << " " << tree;
        }
    }
}

// Oblique planes through a homogeneous cube: what is left of every ray is known.
TEST(RenderClipPlanes, LengthsBetweenObliquePlanesAreExact) {
    Volume const volume = constant_volume({40, 40, 40}, 1.0F, {1, 1, 1});
    RenderSettings s = orthographic("z", 15, 15);
    s.camera.zoom = 4;
    double const sigma = 0.04;
    s.transfer = flat_transfer({1, 1, 1}, -std::expm1(-sigma), 1);
    // 2 x + z >= 50 and z <= 30 - y / 2, across the whole middle.
    s.clip_planes = {2, 0, 1, 50, 0, -0.5, -1, -35};
    Picture const picture = render_one(volume, s);
    double const span = picture.report.camera.height;
    int met = 0;
    for (int v = 0; v < 15; ++v)
        for (int u = 0; u < 15; ++u) {
            double const x = picture.report.camera.target.x + span * ((u + 0.5) / 15 - 0.5),
                         y = picture.report.camera.target.y - span * ((v + 0.5) / 15 - 0.5);
            double const low = std::max(-0.5, 50 - 2 * x), high = std::min(39.5, 35 - 0.5 * y);
            double const length = std::max(0.0, high - low);
            met += length > 0;
            EXPECT_NEAR(static_cast<double>(picture.image.at(u, v)[3]), std::exp(-sigma * length), 2e-6)
                << u << " " << v;
        }
    EXPECT_GT(met, 100);
    s.clip_planes = {0, 0, 1, 1000};
    EXPECT_EQ(render_one(volume, s).center()[3], 1);
}

TEST(RenderClipPlanes, WhatIsNoPlaneIsRefused) {
    Volume const volume = constant_volume({4, 4, 4}, 1.0F, {1, 1, 1});
    for (std::vector<double> const& planes : {std::vector<double>{1, 0, 0},
                                              {0, 0, 0, 1},
                                              {1, 0, std::numeric_limits<double>::infinity(), 0},
                                              std::vector<double>(28, 1.0)}) {
        RenderSettings s;
        s.clip_planes = planes;
        EXPECT_THROW((void)render_one(volume, s), Error);
    }
}
