// Light of environments on marched volumes and surfaces, and of one direction on paths, against closed forms.
// SPDX-License-Identifier: MIT
#include "render_slab.h"
#include "render_trees.h"

#include "libvkt/render/environment.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

using Colour = std::array<double, 3>;

/// An environment of what a function says of the middle of every pixel, a direction of unit length.
std::shared_ptr<Environment const> sky(int width, int height, std::function<Colour(Vec3)> const& light) {
    std::vector<float> pixels;
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u) {
            double const down = half_turn * (v + 0.5) / height, angle = 2 * half_turn * ((u + 0.5) / width - 0.5);
            for (double const c :
                 light({std::sin(down) * std::sin(angle), std::sin(down) * std::cos(angle), std::cos(down)}))
                pixels.push_back(static_cast<float>(c));
        }
    return make_environment(width, height, pixels);
}

std::shared_ptr<Environment const> one_everywhere() {
    return sky(4, 2, [](Vec3) { return Colour{1, 1, 1}; });
}

/// One bright pixel of a picture of 32 x 16.
struct Patch {
    int column = 21, row = 4; ///< to the right and up
    double radiance = 40;

    std::shared_ptr<Environment const> environment() const {
        std::vector<float> pixels(std::size_t{3} * 32 * 16);
        for (int c = 0; c < 3; ++c)
            pixels[static_cast<std::size_t>(3 * (row * 32 + column) + c)] = static_cast<float>(radiance);
        return make_environment(32, 16, pixels);
    }
    double upper() const { return std::cos(half_turn * row / 16); }
    double lower() const { return std::cos(half_turn * (row + 1) / 16); }
    double solid_angle() const { return 2 * half_turn / 32 * (upper() - lower()); }
    Vec3 middle() const {
        double const z = (upper() + lower()) / 2, r = std::sqrt(1 - z * z), a = angle(0.5);
        return {r * std::sin(a), r * std::cos(a), z};
    }
    double angle(double across) const { return 2 * half_turn * ((column + across) / 32 - 0.5); }

    /// Irradiance over pi of a surface, with this instead of the cosine, turned by so many degrees.
    double on(Vec3 normal, double degrees, std::function<double(double)> const& cosine) const {
        constexpr int parts = 40;
        double sum = 0;
        for (int i = 0; i < parts; ++i)
            for (int j = 0; j < parts; ++j) {
                double const z = lower() + (upper() - lower()) * (i + 0.5) / parts, r = std::sqrt(1 - z * z);
                double const a = angle((j + 0.5) / parts) - degrees * half_turn / 180;
                sum += cosine(normal.x * r * std::sin(a) + normal.y * r * std::cos(a) + normal.z * z);
            }
        return radiance * solid_angle() / half_turn * sum / (parts * parts);
    }
};

/// The cosine, cut off at 0, without its orders above the second.
double smooth_cosine(double c) { return 3.0 / 32 + c / 2 + 15.0 / 32 * c * c; }

RenderSettings white_surface() {
    RenderSettings s;
    s.width = s.height = 63;
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {10};
    s.camera.projection = Projection::orthographic; // half of a ball is seen
    s.edge_rays = 1;                                // normals are those of the middle
    s.iso_colors = {1, 1, 1};
    s.specular = 0;
    s.ambient = 1;
    s.layers = true;
    return s;
}

Volume ball() {
    Volume const plain = volume_of({32, 32, 32}, {1, 1, 1}, [](double x, double y, double z) {
        Geometry const g = skewed();
        double const dx = (x - 15.5) * g.spacing.x, dy = (y - 15.5) * g.spacing.y, dz = (z - 15.5) * g.spacing.z;
        return 20 - std::sqrt(dx * dx + dy * dy + dz * dz);
    });
    return with_geometry(plain, skewed());
}

/// Calls f(pixel, normal) where a surface is seen; how many there are.
template <class F> int each_surface(Picture const& p, F const& f) {
    int count = 0;
    for (std::size_t i = 0; i < p.image.pixels.size() / 4; ++i) {
        auto const part = [&](char const* name) { return static_cast<double>(layer(p.report, name).values[i]); };
        Vec3 const normal{part("normal.X"), part("normal.Y"), part("normal.Z")};
        if (normal.x == 0 && normal.y == 0 && normal.z == 0) continue;
        f(&p.image.pixels[4 * i], normal);
        ++count;
    }
    return count;
}

} // namespace

// The moments are integrals over the sphere: of 1, of z, and of second order, also turned.
TEST(RenderIrradiance, MomentsAreIntegralsOverTheSphere) {
    double const all = 4 * half_turn;
    auto const ones = one_everywhere()->moments_of(1, 33);
    std::array<double, 10> const wanted{all, 0, 0, 0, all / 3, all / 3, all / 3, 0, 0, 0};
    for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(ones[i], wanted[i], 1e-12) << i;
    // Light x + 2 y + 3 z + 4 x y + 5 x z + 6 y z + 7 has moments 4 pi / 3 of what is odd, 4 pi / 15 of what is mixed.
    auto const mixed = sky(512, 256, [](Vec3 w) {
        double const l = 30 + w.x + 2 * w.y + 3 * w.z + 4 * w.x * w.y + 5 * w.x * w.z + 6 * w.y * w.z;
        return Colour{l, 0, 2 * l};
    });
    std::array<double, 10> const expected{30 * all,     all / 3,      2 * all / 3,  3 * all / 3,  30 * all / 3,
                                          30 * all / 3, 30 * all / 3, 4 * all / 15, 5 * all / 15, 6 * all / 15};
    for (std::size_t i = 0; i < 10; ++i) {
        EXPECT_NEAR(mixed->moments_of(0, 0)[i], expected[i], 2e-3) << i;
        EXPECT_NEAR(mixed->moments_of(2, 0)[i], 2 * expected[i], 4e-3) << i;
        EXPECT_EQ(mixed->moments_of(1, 50)[i], 0) << i;
    }
    // A quarter turn takes x to y and y to -x.
    auto const turned = mixed->moments_of(0, 90);
    EXPECT_NEAR(turned[1], -2 * all / 3, 2e-3);
    EXPECT_NEAR(turned[2], all / 3, 2e-3);
    EXPECT_NEAR(turned[7], -4 * all / 15, 2e-3);
    EXPECT_NEAR(turned[8], -6 * all / 15, 2e-3);
    EXPECT_NEAR(turned[9], 5 * all / 15, 2e-3);
}

// An environment that is 1 everywhere is the light from everywhere that there is without one.
TEST(RenderIrradiance, OneEverywhereIsTheLightFromEverywhere) {
    Volume const grid = with_geometry(blobs({40, 27, 33}, DataType::float32), skewed()), tree = small_tree();
    for (Volume const* volume : {&grid, &tree})
        for (Algorithm const algorithm : {Algorithm::ray_marching, Algorithm::implicit_iso})
            for (int const directions : {0, 8})
                for (bool const lamp : {false, true}) {
                    RenderSettings s = colourful();
                    s.algorithm = algorithm;
                    s.width = 24, s.height = 18;
                    s.shade = 0.7;
                    s.ambient = 0.6;
                    s.ambient_occlusion = directions;
                    if (lamp) s.light_direction = Vec3{1, -0.5, 0.7};
                    s.clip.text = "10%:,:,:"; // with a cut face
                    Image const plain = render_one(*volume, s).image;
                    s.environment = one_everywhere();
                    EXPECT_LT(greatest_difference(plain, render_one(*volume, s).image), 2e-6)
                        << enum_name(algorithm) << " " << directions << " " << lamp;
                    s.environment_strength = 0;
                    EXPECT_GT(greatest_difference(plain, render_one(*volume, s).image), 0.02);
                }
}

// A surface below a sky whose light is 1 + z has the irradiance pi (1 + 2/3 n_z), which second orders hold exactly.
TEST(RenderIrradiance, ASkyThatBrightensUpwardsIsExact) {
    RenderSettings s = white_surface();
    s.environment = sky(64, 256, [](Vec3 w) { return Colour{1 + w.z, 1, 1 - w.z / 2}; });
    int const seen = each_surface(render_one(ball(), s), [](float const* pixel, Vec3 normal) {
        EXPECT_NEAR(pixel[0], 1 + 2 * normal.z / 3, 1e-4);
        EXPECT_NEAR(pixel[1], 1, 1e-5);
        EXPECT_NEAR(pixel[2], 1 - normal.z / 3, 1e-4);
    });
    EXPECT_GT(seen, 100);
}

// One bright patch: the polynomial over it, in a turned and stretched lattice; and within a tenth of what falls onto a
// surface that faces it, the true irradiance.
TEST(RenderIrradiance, APatchLightsByThePolynomial) {
    RenderSettings s = white_surface();
    Patch const patch;
    s.environment = patch.environment();
    for (double const turned : {0.0, 70.0}) {
        s.environment_rotation = turned;
        double const most = patch.radiance * patch.solid_angle() / half_turn;
        double darkest = most, brightest = 0;
        int const seen = each_surface(render_one(ball(), s), [&](float const* pixel, Vec3 normal) {
            double const found = pixel[0];
            double const wanted = std::max(0.0, patch.on(normal, turned, smooth_cosine));
            EXPECT_NEAR(found, wanted, 1e-5 * most);
            double const truth = patch.on(normal, turned, [](double c) { return std::max(c, 0.0); });
            EXPECT_NEAR(found, truth, 0.1 * most);
            darkest = std::min(darkest, found), brightest = std::max(brightest, found);
        });
        EXPECT_GT(seen, 100);
        EXPECT_LT(darkest, 0.1 * most);
        EXPECT_GT(brightest, 0.8 * most);
    }
}

// What is marched and is no surface has the mean of all directions; a cut face that of its normal.
TEST(RenderIrradiance, FogHasTheMeanAndCutsTheirNormal) {
    Slab slab(2, Algorithm::ray_marching);
    RenderSettings& s = slab.settings;
    s.environment = sky(64, 256, [](Vec3 w) { return Colour{1 + w.z, 0.5, 3}; });
    s.ambient = 1;
    s.shade = 0;
    double const all = -std::expm1(-2.0);
    Picture const fog = render_one(slab.volume, s);
    EXPECT_NEAR(fog.center()[0], all, 1e-4);
    EXPECT_NEAR(fog.center()[1], all / 2, 1e-4);
    EXPECT_NEAR(fog.center()[2], 3 * all, 3e-4);
    // Light from all around that the slab holds back, too: that of each direction counts alike.
    s.ambient_occlusion = 32;
    s.occlusion_radius = 1e4;
    Picture const dim = render_one(slab.volume, s);
    s.environment = nullptr;
    Picture const plain = render_one(slab.volume, s);
    EXPECT_NEAR(dim.center()[2], 3 * plain.center()[2], 1e-4);
    // As good as opaque, shaded: all of the light comes from next to the face.
    Slab solid(400, Algorithm::ray_marching);
    solid.settings.environment = sky(64, 256, [](Vec3 w) { return Colour{1 + w.z, 0.5, 3}; });
    solid.settings.ambient = 1;
    solid.settings.shade = 1;
    solid.settings.specular = 0;
    Picture const face = render_one(solid.volume, solid.settings);
    EXPECT_NEAR(face.center()[0], 1 + 2.0 / 3, 1e-3);
    EXPECT_NEAR(face.center()[1], 0.5, 1e-3);
    EXPECT_NEAR(face.center()[2], 3, 3e-3);
}

TEST(RenderIrradiance, SkippingThreadsAndInstructionsChangeNoBit) {
    RenderSettings s = colourful();
    s.environment = Patch().environment();
    s.shade = 0.7;
    expect_no_bit_changes(blobs({40, 27, 33}, DataType::uint16), s, "grid");
    s.shadows = true;
    s.light_direction = Vec3{1, -0.5, 0.7};
    s.ambient_occlusion = 6;
    expect_no_bit_changes(blobs({40, 27, 33}, DataType::uint16), s, "grid with shadows");
    s.width = s.height = 24;
    expect_no_bit_changes(small_tree(), s, "tree");
}

// A slab lit from one direction that scatters once: the closed form, thin and thick, from before and behind.
TEST(RenderLamp, OneScatteringInASlabIsTheClosedForm) {
    constexpr int samples = 4000;
    for (double const depth : {0.01, 1.5})
        for (double const cosine : {1.0, 0.6, -0.8})
            for (double const g : {0.0, 0.6}) {
                Slab slab(depth, Algorithm::multi_scattering);
                RenderSettings& s = slab.settings;
                s.samples = samples;
                s.bounces = 2;
                s.albedo = 0.8;
                s.anisotropy = g;
                s.ambient = 0;
                s.light_direction = Vec3{3 * std::sqrt(1 - cosine * cosine), 0, 3 * cosine};
                double const most = 0.8 * 4 * half_turn * phase_of(g, -cosine);
                double const wanted = most * once_scattered(depth, cosine);
                double const found = mean_of_channel(render_one(slab.volume, s).image, 0);
                // The light of a path lies between 0 and that of an unattenuated scattering.
                EXPECT_NEAR(found, wanted, 4 * std::sqrt(wanted * most / (64.0 * samples)))
                    << depth << " " << cosine << " " << g;
            }
}

// It is the limit of a small and bright pixel of an environment, with all that is scattered on.
TEST(RenderLamp, AgreesWithTheSameLightInOnePixel) {
    Volume const grid = blobs({24, 18, 30}, DataType::float32), tree = small_tree();
    for (Volume const* volume : {&grid, &tree})
        for (double const g : {0.0, 0.5}) {
            RenderSettings s;
            s.width = s.height = 24;
            s.algorithm = Algorithm::multi_scattering;
            s.samples = 200;
            s.anisotropy = g;
            s.transfer = flat_transfer({1, 1, 1}, 0.3, 1);
            s.light = {1, 0.5, 2};
            Patch patch;
            patch.radiance = 4 * half_turn / patch.solid_angle();
            RenderSettings by_lamp = s;
            s.environment = patch.environment();
            by_lamp.ambient = 0;
            by_lamp.light_direction = patch.middle();
            Image const pixel = render_one(*volume, s).image, lamp = render_one(*volume, by_lamp).image;
            double const one = mean_of_channel(pixel, 1), other = mean_of_channel(lamp, 1);
            EXPECT_GT(one, 0.02);
            // Some 50,000 paths that bring 1 or 2 at most; 0.2 radians of the patch.
            EXPECT_NEAR(other, one, 0.03 * one) << g;
            EXPECT_NEAR(mean_of_channel(lamp, 0), 2 * other, 1e-5 * other);
            EXPECT_NEAR(mean_of_channel(lamp, 2), 4 * other, 1e-5 * other);
            // Where each pixel is lit as well: sums of 6 x 6.
            double worst = 0, largest = 0;
            for (int y = 0; y < 24; y += 6)
                for (int x = 0; x < 24; x += 6) {
                    double a = 0, b = 0;
                    for (int v = y; v < y + 6; ++v)
                        for (int u = x; u < x + 6; ++u)
                            a += static_cast<double>(pixel.at(u, v)[1]), b += static_cast<double>(lamp.at(u, v)[1]);
                    worst = std::max(worst, std::abs(a - b)), largest = std::max(largest, a);
                }
            EXPECT_LT(worst, 0.1 * largest);
        }
}

// What nothing holds back is scattered in all directions alike as much as light from everywhere, whatever the shares.
TEST(RenderLamp, ThinMediaScatterItAsLightFromEverywhere) {
    for (double const ambient : {0.0, 0.25, 1.0}) {
        Slab slab(0.01, Algorithm::multi_scattering);
        slab.settings.samples = 4000;
        slab.settings.ambient = ambient;
        slab.settings.light_direction = Vec3{0.2, 0, 1};
        Picture const picture = render_one(slab.volume, slab.settings);
        EXPECT_NEAR(mean_of_channel(picture.image, 0) / (1 - mean_of_channel(picture.image, 3)), 1, 0.03) << ambient;
    }
}

TEST(RenderLamp, PassesAndThreadsChangeNoBit) {
    Volume const volume = blobs({24, 18, 30}, DataType::uint8);
    RenderSettings s;
    s.width = s.height = 20;
    s.algorithm = Algorithm::multi_scattering;
    s.light_direction = Vec3{1, 1, 1};
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
    s.samples = 7;
    s.light_direction.reset();
    EXPECT_NE(all.pixels, render::render(volume, s, one).pixels);
}
