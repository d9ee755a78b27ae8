// Multiple scattering: transmittance, furnace, single scattering in closed form, agreement with the marcher.
// SPDX-License-Identifier: MIT
#include "libvkt/render/inner/random.h"
#include "libvkt/render/inner/scatter.h"
#include "tests/unit/render_testing.h"

#include <gtest/gtest.h>

#include <cmath>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

RenderSettings scattering(std::string view, int size, int samples) {
    RenderSettings s = orthographic(std::move(view), size, size);
    s.algorithm = Algorithm::multi_scattering;
    s.samples = samples;
    return s;
}

} // namespace

// Known answers of Philox4x32-10 from its authors (Random123, kat_vectors).
TEST(RenderScatter, PhiloxGivesTheKnownNumbers) {
    PhiloxBlock const zero = philox({{0, 0, 0, 0}}, 0, 0);
    EXPECT_EQ(zero.word[0], 0x6627e8d5U);
    EXPECT_EQ(zero.word[1], 0xe169c58dU);
    EXPECT_EQ(zero.word[2], 0xbc57ac4cU);
    EXPECT_EQ(zero.word[3], 0x9b00dbd8U);
    PhiloxBlock const ones = philox({{~0U, ~0U, ~0U, ~0U}}, ~0U, ~0U);
    EXPECT_EQ(ones.word[0], 0x408f276dU);
    EXPECT_EQ(ones.word[1], 0x41c83b0eU);
    EXPECT_EQ(ones.word[2], 0xa20bc7c6U);
    EXPECT_EQ(ones.word[3], 0x6d5451fdU);
}

// The share of camera rays that meet nothing is exp(-sigma D) within its binomial deviation.
TEST(RenderScatter, TransmittanceIsExponential) {
    Volume volume = constant_volume({24, 30, 20}, 1.0F, {1, 1, 2});
    for (double const depth : {0.25, 1.0, 3.0, 7.0}) {
        RenderSettings s = scattering("z", 48, 200);
        s.albedo = 0;
        s.camera.zoom = 4; // all pixels inside
        double const sigma = depth / 40;
        s.transfer = flat_transfer({1, 1, 1}, -std::expm1(-sigma), 1);
        Picture const picture = render_one(volume, s);
        double mean = 0;
        for (std::size_t i = 3; i < picture.image.pixels.size(); i += 4)
            mean += static_cast<double>(picture.image.pixels[i]);
        double const n = 48 * 48, expected = std::exp(-depth);
        double const deviation = std::sqrt(expected * (1 - expected) / (n * s.samples));
        EXPECT_LT(std::abs(mean / n - expected), 4 * deviation) << depth;
    }
}

// White light from everywhere on a medium that absorbs nothing: every path brings exactly 1.
TEST(RenderScatter, FurnaceIsExactlyOne) {
    Volume volume = blobs({24, 18, 30}, DataType::float32);
    for (double const anisotropy : {0.0, 0.8, -0.6}) {
        RenderSettings s = scattering("oblique", 24, 16);
        s.anisotropy = anisotropy;
        s.transfer = flat_transfer({1, 1, 1}, 0.3, 1);
        Picture const picture = render_one(volume, s);
        EXPECT_EQ(picture.report.capped, 0);
        for (std::size_t i = 0; i < picture.image.pixels.size(); i += 4)
            for (std::size_t c = 0; c < 3; ++c)
                EXPECT_FLOAT_EQ(picture.image.pixels[i + c] + picture.image.pixels[i + 3], 1.0F) << anisotropy;
    }
}

// Moments of the phase function: the mean cosine is g, the mean square (1 + 2 g^2) / 3.
TEST(RenderScatter, HenyeyGreensteinHasItsMoments) {
    for (float const g : {-0.95F, -0.5F, -1e-3F, 0.0F, 1e-5F, 0.3F, 0.75F, 0.99F}) {
        constexpr int n = 1 << 18;
        double first = 0, second = 0;
        for (int i = 0; i < n; ++i) {
            auto const cosine = static_cast<double>(henyey_greenstein_cosine(g, (static_cast<float>(i) + 0.5F) / n));
            first += cosine / n;
            second += cosine * cosine / n;
        }
        EXPECT_NEAR(first, static_cast<double>(g), 2e-6) << g;
        EXPECT_NEAR(second, (1 + 2 * static_cast<double>(g) * static_cast<double>(g)) / 3, 4e-6) << g;
    }
    for (Double3 const axis : {Double3{0, 0, 2}, Double3{0, 0, -1}, Double3{1, -2, 0.5}, Double3{-3, 1e-9, 0}})
        for (float const angle : {0.0F, 1.0F, 4.0F}) {
            Double3 const way = direction_around(axis, 0.25F, angle);
            EXPECT_NEAR(dot(way, way), 1, 1e-12);
            EXPECT_NEAR(dot(way, axis), 0.25 * std::sqrt(dot(axis, axis)), 1e-12);
        }
}

// What leaves a slab of optical thickness 2 whose albedo is 0.9 with g = 0.75, met head-on: 0.09739 of the light is
// reflected and 0.66096 transmitted, e^-2 of it unscattered (van de Hulst, Multiple Light Scattering, 1980, table 35).
// Light from all around brings the sum of what is scattered out on either side.
TEST(RenderScatter, AnisotropicSlabAgreesWithVanDeHulst) {
    Volume volume = constant_volume({400, 400, 4}, 1.0F, {1, 1, 0.5}); // wide: 200 times as wide as it is thick
    RenderSettings s = scattering("z", 16, 800);
    s.anisotropy = 0.75;
    s.albedo = 0.9;
    s.camera.zoom = 100;
    s.transfer = flat_transfer({1, 1, 1}, -std::expm1(-1.0), 1); // extinction 1, thickness 2
    Picture const picture = render_one(volume, s);
    double light = 0, through = 0;
    for (std::size_t i = 0; i < picture.image.pixels.size(); i += 4) {
        light += static_cast<double>(picture.image.pixels[i]) / 256;
        through += static_cast<double>(picture.image.pixels[i + 3]) / 256;
    }
    // 204800 paths, whose light has a standard deviation of at most 1/2
    EXPECT_NEAR(through, std::exp(-2.0), 4 * 0.35 / std::sqrt(204800.0));
    EXPECT_NEAR(light, 0.09739 + 0.66096 - std::exp(-2.0), 4 * 0.5 / std::sqrt(204800.0));
}

// Without scattering but with glow, paths estimate what the marcher integrates.
TEST(RenderScatter, AbsorptionAndEmissionAgreeWithMarching) {
    for (DataType const type : {DataType::uint8, DataType::float32}) {
        Volume volume = blobs({24, 18, 30}, type);
        RenderSettings s = scattering("oblique", 24, 4000);
        s.lut = {1, 0.5, 0.2, 0, 0.4, 0.6, 0.8, 0.05, 0.9, 0.9, 0.3, 0.4};
        s.albedo = 0;
        s.emission = true;
        Picture const paths = render_one(volume, s);
        s.algorithm = Algorithm::ray_marching;
        s.step = 1.0 / 16;
        s.shade = 0;
        // Paths average over pixels; so does marching at eight times the size.
        s.width = s.height = 192;
        Picture const marched = render_one(volume, s);
        double squares = 0;
        int met = 0;
        for (int y = 0; y < 24; ++y)
            for (int x = 0; x < 24; ++x)
                for (int c : {0, 1, 2, 3}) {
                    double mean = 0;
                    for (int v = 0; v < 8; ++v)
                        for (int u = 0; u < 8; ++u)
                            mean += static_cast<double>(marched.image.at(8 * x + u, 8 * y + v)[c]) / 64;
                    double const difference = static_cast<double>(paths.image.at(x, y)[c]) - mean;
                    // Single contributions lie in [0,1], so their variance is at most mean (1 - mean).
                    double const variance = std::max(mean * (1 - mean), 1e-4) / 4000;
                    EXPECT_LT(std::abs(difference), 6 * std::sqrt(variance) + 1e-3) << x << " " << y << " " << c;
                    squares += difference * difference / variance;
                    met += mean > 1e-3 && mean < 1 - 1e-3;
                }
        EXPECT_GT(met, 200);
        EXPECT_LT(squares / (24 * 24 * 4), 1.5);
    }
}

// Infinite slab, albedo 0.9, one scattering: 0.591248 for optical depth 1 (e^-1 + 0.223368).
TEST(RenderScatter, SingleScatteringInASlab) {
    // Wide against its thickness; only its middle is looked at.
    Volume volume = constant_volume({1000, 1000, 10}, 1.0F, {1, 1, 1});
    RenderSettings s = scattering("z", 32, 400);
    s.camera.zoom = 100;
    s.camera.fit = Fit::volume;
    s.transfer = flat_transfer({1, 1, 1}, -std::expm1(-0.1), 1);
    s.albedo = 0.9;
    s.bounces = 2; // paths that meet the medium a second time are cut
    Picture const picture = render_one(volume, s);
    double mean = 0;
    for (std::size_t i = 0; i < picture.image.pixels.size(); i += 4)
        mean += static_cast<double>(picture.image.pixels[i] + picture.image.pixels[i + 3]) / (32 * 32);
    double const deviation = 0.5 / std::sqrt(32.0 * 32 * 400);
    EXPECT_NEAR(mean, 0.591248, 4 * deviation);
}

TEST(RenderScatter, ThreadsAndSkippingDoNotMatterAndSamplesAddUp) {
    Volume volume = blobs({24, 18, 30}, DataType::int16);
    RenderSettings s = scattering("oblique", 40, 6);
    Execution one, three;
    three.threads = 3;
    Image const all = render::render(volume, s, one);
    EXPECT_EQ(all.pixels, render::render(volume, s, three).pixels);
    // Two halves, rendered apart, average to the whole.
    s.samples = 3;
    Image const first = render::render(volume, s, one);
    s.first_sample = 3;
    Image const second = render::render(volume, s, one);
    for (std::size_t i = 0; i < all.pixels.size(); ++i)
        ASSERT_NEAR(all.pixels[i], (first.pixels[i] + second.pixels[i]) / 2, 1e-6);
    s.seed = 1;
    EXPECT_NE(second.pixels, render::render(volume, s, one).pixels);
}
