// Ray marching against closed forms: slab, ramp, spike, missing data, skipping, threads, cameras.
// SPDX-License-Identifier: MIT
#include "libvkt/core/execution.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/render.h"
#include "tests/unit/render_testing.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

/// Value t/depth along z of the lattice, exactly: no voxels in between.
struct Ramp : PointSampler<Ramp> {
    using Real = float;
    using Vector = Float3;
    static constexpr bool skips_exactly = false;
    double depth = 1;
    VKT_HD static Vector place(Double3 p) { return to_float(p); }
    VKT_HD static Vector cell_origin() { return {0, 0, 0}; }
    VKT_HD static Real cell_size() { return macrocell_size; }
    VKT_HD float value(Float3 p) const { return static_cast<float>(p.z / depth); }
    VKT_HD Float3 gradient(Float3) const { return {0, 0, 1}; }
    VKT_HD void corners(int, int, int z, float* c) const {
        for (int k = 0; k < 8; ++k) c[k] = value({0, 0, static_cast<float>(z + k / 4)});
    }
};

/// A ray along z through a medium of the given knots, marched or exact.
ExactRadiance along_ramp(std::vector<Knot> const& knots, double depth, double step, bool exact, double world = 1) {
    TransferTable const table(knots, 8192);
    SceneView scene{};
    scene.table = table.view();
    scene.knots = knots.data();
    scene.knot_count = static_cast<int>(knots.size());
    scene.step = static_cast<float>(step);
    Ramp ramp;
    ramp.depth = depth;
    Ray const ray{{2, 2, 0}, {0, 0, 1}, depth, world};
    Counters counters;
    if (exact) return exact_integral(ramp, scene, ray, counters);
    Radiance const r = march_ray(ramp, scene, ray, counters);
    return {static_cast<double>(r.red), static_cast<double>(r.green), static_cast<double>(r.blue),
            static_cast<double>(r.transmittance)};
}

double order(std::vector<double> const& errors) {
    return std::log2(errors.front() / errors.back()) / static_cast<double>(errors.size() - 1);
}

} // namespace

TEST(RenderMarch, AttenuationAgreesWithTheLibrary) {
    for (double t = 1e-9; t < 100; t *= 1.01) {
        auto const f = static_cast<float>(t);
        Attenuation const a = attenuation(f);
        EXPECT_NEAR(a.absorbed, -std::expm1(-static_cast<double>(f)), 3e-7 * -std::expm1(-static_cast<double>(f)));
        if (f >= 87) continue; // limited there
        EXPECT_NEAR(a.transmitted, std::exp(-static_cast<double>(f)), 3e-7 * std::exp(-static_cast<double>(f)));
    }
    EXPECT_EQ(attenuation(0).absorbed, 0);
    EXPECT_EQ(attenuation(0).transmitted, 1);
}

TEST(RenderMarch, OpacityBecomesExtinction) {
    EXPECT_EQ(extinction_of(0), 0);
    EXPECT_DOUBLE_EQ(extinction_of(1e-8), -std::log1p(-1e-8));
    EXPECT_DOUBLE_EQ(extinction_of(1e-4), -std::log1p(-1e-4));
    EXPECT_DOUBLE_EQ(extinction_of(0.5), std::log(2.0));
    EXPECT_EQ(extinction_of(1), 16);
}

// T = exp(-sigma D) whatever the step, along every axis of an anisotropic volume, with all opacities.
TEST(RenderMarch, ConstantSlabIsExactForAnyStep) {
    Volume volume = constant_volume({9, 14, 20}, 3.0F, {1, 2, 5});
    for (double const alpha : {0.0, 1e-8, 1e-4, 0.05, 0.5})
        for (double const step : {4.0, 1.0, 0.37, 1.0 / 16})
            for (auto const& [view, length] :
                 std::vector<std::pair<std::string, double>>{{"x", 9.0}, {"-y", 28.0}, {"z", 100.0}}) {
                RenderSettings s = orthographic(view, 9, 9);
                s.transfer = flat_transfer({0.5, 0.25, 1}, alpha, 10);
                s.step = step;
                auto const image = render_one(volume, s);
                float const* p = image.center();
                double const depth = extinction_of(alpha) * length / 10, through = std::exp(-depth);
                // A ray ends when less than 1/1024 comes through.
                double const slack = through < 1.0 / 1024 ? 1.0 / 1024 : 2e-6 * (1 + depth) * through;
                EXPECT_NEAR(p[3], through, slack) << alpha << " " << step << " " << view;
                EXPECT_NEAR(p[0], 0.5 * (1 - through), slack + 1e-6 * (1 - through))
                    << alpha << " " << step << " " << view;
                EXPECT_NEAR(p[1], 0.25 * (1 - through), slack + 1e-6 * (1 - through));
            }
}

TEST(RenderMarch, OpaqueMeansOpaqueAndNothingIsNotANumber) {
    Volume volume = constant_volume({7, 5, 6}, 1.0F, {1, 1, 1});
    RenderSettings s = orthographic("x", 16, 16);
    s.transfer = flat_transfer({1, 1, 1}, 1, 1);
    for (double const step : {1.0 / 256, 0.5, 4.0}) {
        s.step = step;
        Picture const picture = render_one(volume, s);
        for (float const v : picture.image.pixels) EXPECT_TRUE(std::isfinite(v));
        EXPECT_LT(picture.center()[3], 1.0 / 1024);
        EXPECT_NEAR(picture.center()[0], 1, 1.0 / 1024);
    }
}

// Extinction c t/D and colour t/D for c = 8, D = 1: L = -e^(-c/2) + sqrt(pi/2c) erf(sqrt(c/2)) = 0.422725056.
TEST(RenderMarch, RampConvergesWithSecondOrderAndIsExact) {
    double const c = 8;
    double const expected = -std::exp(-c / 2) + std::sqrt(std::numbers::pi / (2 * c)) * std::erf(std::sqrt(c / 2));
    ASSERT_NEAR(expected, 0.422725056, 1e-9);
    std::vector<Knot> const knots{{0, 0, 0, 0, 0}, {1, c, 1, 1, 1}};
    std::vector<double> marched;
    for (int n = 8; n <= 64; n *= 2) {
        // A lattice length of 1 keeps table and step in the same units.
        marched.push_back(std::abs(along_ramp(knots, 1, 1.0 / n, false).red - expected));
        EXPECT_NEAR(along_ramp(knots, 1, 1.0 / n, false).transmittance, std::exp(-c / 2), 1e-6);
    }
    EXPECT_NEAR(along_ramp(knots, 1, 1, true).red, expected, 1e-10);
    EXPECT_NEAR(along_ramp(knots, 1, 1, true).transmittance, std::exp(-c / 2), 1e-14);
    EXPECT_NEAR(order(marched), 2.0, 0.1);
    EXPECT_LT(marched.back(), 1e-4);
}

// A box of width w and height s on a ramp of slope 1 has depth s w, however narrow it is and however long the step.
TEST(RenderMarch, SpikeKeepsItsDepthForAnyStep) {
    for (double const width : {0.1, 0.003, 1e-5})
        for (double const step : {4.0, 1.0, 0.3}) {
            double const depth = 0.8, a = 0.43712;
            std::vector<Knot> const knots{{0, 0, 1, 1, 1},
                                          {a, 0, 1, 1, 1},
                                          {a, depth / width, 1, 1, 1},
                                          {a + width, depth / width, 1, 1, 1},
                                          {a + width, 0, 1, 1, 1},
                                          {1, 0, 1, 1, 1}};
            ExactRadiance const r = along_ramp(knots, 20, step, false, 1.0 / 20);
            EXPECT_NEAR(r.transmittance, std::exp(-depth), 4e-3) << width << " " << step;
            EXPECT_NEAR(r.red, 1 - std::exp(-depth), 4e-3) << width << " " << step;
        }
}

// The same with a domain that is small compared to what values do within one step, as windows on CT data are.
TEST(RenderMarch, NarrowDomainsKeepTheirDepthForAnyStep) {
    for (double const sign : {1.0, -1.0}) {
        Volume const ramp = volume_of({16, 3, 3}, {1, 1, 1},
                                      [=](double x, double, double) { return 1000 + sign * (4000 * x / 15 - 2000); });
        RenderSettings s = orthographic("x", 9, 9);
        s.transfer.emplace();
        s.transfer->points = {{999.5, {1, 1, 1}, 0}, {1000, {1, 1, 1}, 0.9}, {1000.5, {1, 1, 1}, 0}};
        double const depth = 0.5 * extinction_of(0.9) / (4000.0 / 15);
        for (double const step : {4.0, 2.0, 0.5, 0.25}) {
            s.step = step;
            EXPECT_NEAR(1 - render_one(ramp, s).center()[3], depth, 0.02 * depth) << step;
        }
    }
}

TEST(RenderMarch, RegistersOfGradientsReflectWithTheBitsOfOne) {
    ShadeView const shade{0.8F, 0.3F, 0.4F, 2.5F, 0.7F, {1, 2, 0.5F, 0.1F, -0.2F, 0.3F}};
    LampFrame const frame{{0.1F, -0.9F, 0.4F}, {0.5F, 0.6F, 0.62F}, {0.6F, 0.7F, -0.3F}};
    Arriving const light{0.7F, 0.9F};
    constexpr float infinite = std::numeric_limits<float>::infinity();
    std::vector<float> parts{0,     1e-30F, -3e-5F, 0.3F,     -2,        41,           -1e14F,
                             3e14F, -1e20F, 3e37F,  infinite, -infinite, std::nanf("")};
    alignas(64) float x[wide], y[wide], z[wide];
    for (std::size_t i = 0; i < parts.size() * parts.size(); ++i) {
        for (std::size_t j = 0; j < wide; ++j) {
            x[j] = parts[(i + j) % parts.size()], y[j] = parts[(i / parts.size() + 3 * j) % parts.size()];
            z[j] = parts[(7 * i + 5 * j + 2) % parts.size()];
        }
        Floats const gx = in_references(shade, floats_at(x)), gy = in_references(shade, floats_at(y)),
                     gz = in_references(shade, floats_at(z));
        auto const eye = headlight(shade, gx, gy, gz, gx * 0.5F - gz, 0.6F, 0.9F, 1.0F);
        auto const lamp = lamplight(shade, gx, gy, gz, frame.of(gx, gy, gz), light, 0.9F, 1.0F);
        for (int j = 0; j < wide; ++j) {
            float const a = in_references(shade, x[j]), b = in_references(shade, y[j]), c = in_references(shade, z[j]);
            auto const one = headlight(shade, a, b, c, a * 0.5F - c, 0.6F, 0.9F, 1.0F);
            auto const other = lamplight(shade, a, b, c, frame.of(a, b, c), light, 0.9F, 1.0F);
            auto const same = [](float p, float q) { return p == q || (std::isnan(p) && std::isnan(q)); };
            EXPECT_TRUE(same(eye.diffuse[j], one.diffuse) && same(eye.glint[j], one.glint)) << a << b << c;
            EXPECT_TRUE(same(lamp.diffuse[j], other.diffuse) && same(lamp.glint[j], other.glint)) << a << b << c;
        }
    }
}

TEST(RenderMarch, SkippingThreadsAndInstructionSetsChangeNoBit) {
    for (DataType const type :
         {DataType::uint8, DataType::uint16, DataType::int16, DataType::float32, DataType::float64}) {
        Volume volume = blobs({37, 29, 45}, type);
        for (double const step : {0.23, 1.0, 3.7}) {
            RenderSettings s;
            s.width = 61, s.height = 47;
            s.step = step;
            s.shade = 0.7;
            auto const [with, without] = expect_no_bit_changes(volume, s, text(name_of(type), " ", step));
            EXPECT_LT(with.samples, without.samples);
            EXPECT_GT(with.skipped, 0.1);
        }
    }
}

// A steep transfer function with gaps of zero between its bands: a jump over one band must not be skipped.
TEST(RenderMarch, SkippingIsExactForBandedTransferFunctions) {
    Volume volume = blobs({33, 40, 21}, DataType::float32);
    RenderSettings s;
    s.width = s.height = 50;
    s.lut = {1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.9, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1, 1};
    for (double const step : {0.1, 0.9, 4.0}) {
        s.step = step;
        s.skip = true;
        Picture const a = render_one(volume, s);
        s.skip = false;
        EXPECT_EQ(a.image.pixels, render_one(volume, s).image.pixels) << step;
    }
}

TEST(RenderMarch, ExactAgreesWithFineSteps) {
    Volume volume = blobs({30, 24, 36}, DataType::uint8);
    RenderSettings s;
    s.width = s.height = 40;
    s.lut = {1, 0.5, 0.2, 0, 0.4, 0.6, 0.8, 0.02, 0.9, 0.9, 0.3, 0.2};
    s.shade = 0;
    s.step = 1.0 / 64;
    Picture const fine = render_one(volume, s);
    s.step = 0.5;
    s.exact = true;
    EXPECT_LT(greatest_difference(fine.image, render_one(volume, s).image), 2e-3);
}

namespace {

/// The sum over very many short steps with the value in their middle, in nothing but loops.
std::array<double, 4> brute_force(std::vector<float> const& cells, int n, std::vector<Knot> const& knots,
                                  Ray const& ray) {
    constexpr int steps = 1'000'000;
    double const dt = ray.length / steps;
    double light[3] = {}, depth = 0;
    for (int k = 0; k < steps; ++k) {
        Double3 const p = ray.entry + ray.direction * ((k + 0.5) * dt);
        int const x = static_cast<int>(p.x), y = static_cast<int>(p.y), z = static_cast<int>(p.z);
        double value = 0;
        for (int corner = 0; corner < 8; ++corner) {
            int const i = x + (corner & 1), j = y + (corner >> 1 & 1), l = z + (corner >> 2);
            value += (1 - std::abs(p.x - i)) * (1 - std::abs(p.y - j)) * (1 - std::abs(p.z - l)) *
                     static_cast<double>(cells[static_cast<std::size_t>((l * n + j) * n + i)]);
        }
        std::size_t next = 0;
        while (next < knots.size() && knots[next].value <= value) ++next;
        Knot const &a = knots[next > 0 ? next - 1 : 0], &b = knots[std::min(next, knots.size() - 1)];
        double const f = b.value > a.value ? (value - a.value) / (b.value - a.value) : 0;
        double const through = (a.extinction + f * (b.extinction - a.extinction)) * dt * ray.world_per_lattice;
        double const share = std::exp(-depth) * -std::expm1(-through);
        light[0] += share * (a.red + f * (b.red - a.red));
        light[1] += share * (a.green + f * (b.green - a.green));
        light[2] += share * (a.blue + f * (b.blue - a.blue));
        depth += through;
    }
    return {light[0], light[1], light[2], std::exp(-depth)};
}

} // namespace

// Noise and opacities with steps, spikes and edges: values pass many of them within one cell, and turn back.
TEST(RenderMarch, ExactAgreesWithBruteForceOnNoise) {
    constexpr int n = 8;
    std::mt19937 random(11);
    std::uniform_real_distribution<float> share(0, 1);
    std::vector<float> cells(n * n * n);
    for (float& cell : cells) cell = share(random);
    LatticeSampler<float> const sampler{cells.data(), n, n * n, true};
    for (int trial = 0; trial < 6; ++trial) {
        std::vector<Knot> knots;
        for (int i = 0; i < 12; ++i)
            knots.push_back({i > 0 && i % 4 == 0 ? knots.back().value : i / 11.0,
                             i % 3 == 2 ? 0.0 : 16.0 * std::pow(static_cast<double>(share(random)), 2),
                             static_cast<double>(share(random)), static_cast<double>(share(random)),
                             static_cast<double>(share(random))});
        SceneView scene{};
        scene.knots = knots.data();
        scene.knot_count = static_cast<int>(knots.size());
        Double3 const way{0.5 + trial * 0.2, 1.0 - trial * 0.3, -0.7};
        double const norm = std::sqrt(dot(way, way));
        Ray ray{{1.3, 3.6, 5.4}, way * (1 / norm), 0, 0.2};
        ray.length = 0.99 * std::min({5.0 / std::abs(ray.direction.x), 2.4 / std::abs(ray.direction.y),
                                      4.0 / std::abs(ray.direction.z)});
        Counters counters;
        ExactRadiance const exact = exact_integral(sampler, scene, ray, counters);
        auto const expected = brute_force(cells, n, knots, ray);
        EXPECT_NEAR(exact.red, expected[0], 3e-5) << trial;
        EXPECT_NEAR(exact.green, expected[1], 3e-5) << trial;
        EXPECT_NEAR(exact.blue, expected[2], 3e-5) << trial;
        EXPECT_NEAR(exact.transmittance, expected[3], 3e-5) << trial;
    }
}

// Whatever is behind the point where a ray ends, and however dark what is before it.
TEST(RenderMarch, EarlyEndsCostAQuarterOfALevel) {
    auto const level = [](float light) {
        return 255 * linear_to_srgb(std::clamp(static_cast<double>(light), 0.0, 1.0));
    };
    Volume const volume = volume_of({40, 3, 3}, {1, 1, 1}, [](double x, double, double) { return x < 20 ? 1.0 : 0.0; });
    double worst = 0;
    for (double const front : {0.0, 0.001, 0.003, 0.01, 0.05, 0.2, 0.3, 1.0})
        for (double const back : {0.0, 1.0})
            for (double depth = 6; depth < 11; depth += 0.05) {
                RenderSettings s = orthographic("-x", 1, 1);
                s.transfer.emplace();
                s.transfer->linear_colors = true;
                s.transfer->unit = 1;
                double const alpha = -std::expm1(-depth / 20);
                Color const one{back, back, back}, two{front, front, front};
                s.transfer->points = {{0, one, 0.9}, {0.5, one, 0.9}, {0.5, two, alpha}, {1, two, alpha}};
                Image const marched = render_one(volume, s).image;
                s.exact = true;
                Image const exact = render_one(volume, s).image;
                for (std::size_t c = 0; c < 3; ++c)
                    for (float const behind : {0.0F, 1.0F})
                        worst = std::max(worst, std::abs(level(marched.pixels[c] + behind * marched.pixels[3]) -
                                                         level(exact.pixels[c] + behind * exact.pixels[3])));
            }
    EXPECT_LT(worst, 0.27); // a quarter, and what the step costs
    EXPECT_GT(worst, 0.1);  // it is an end that is measured here
}

TEST(RenderMarch, MissingDataIsEmpty) {
    // A shell of NaN around a block: the picture is that of the block with nothing around it.
    Index3 const dims{24, 18, 21};
    Volume nan = constant_volume(dims, 1.0F, {1, 1, 1});
    auto const w = nan.mutable_view().as<float>();
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x)
                if (x < 5 || y < 4 || z < 6 || x > 18) w(x, y, z) = std::numeric_limits<float>::quiet_NaN();
    RenderSettings s = orthographic("x", 20, 20);
    s.transfer = flat_transfer({1, 1, 1}, 0.1, 1);
    s.step = 0.25;
    RenderReport report;
    Image const image = render::render(nan, s, {}, &report);
    EXPECT_GT(report.missing, 0);
    for (float const p : image.pixels) EXPECT_TRUE(std::isfinite(p));
    // Cells with a missing corner are empty: data from the centre of voxel 5 to that of voxel 18, 13 voxels.
    double const expected = std::exp(-extinction_of(0.1) * 13);
    float const* const p = image.at(10, 10);
    EXPECT_NEAR(p[3], expected, 0.06 * expected);
    EXPECT_GE(p[3], expected * 0.999);
    EXPECT_EQ(image.pixels, [&] {
        s.skip = false;
        return render::render(nan, s, {}, nullptr).pixels;
    }());
}

TEST(RenderMarch, CameraInsideSeesWhatIsAhead) {
    Volume volume = constant_volume({30, 20, 26}, 1.0F, {1, 1, 1});
    RenderSettings s = orthographic("x", 9, 9);
    s.camera.projection = Projection::perspective;
    s.transfer = flat_transfer({1, 1, 1}, 0.05, 1);
    s.camera.target = Vec3{29.5, 9.5, 12.5};
    for (double const eye : {-0.5, 3.0, 22.0}) { // on a face, inside, further inside
        s.camera.eye = Vec3{eye, 9.5, 12.5};
        EXPECT_NEAR(render_one(volume, s).center()[3], std::exp(-extinction_of(0.05) * (29.5 - eye)), 2e-6) << eye;
    }
    s.camera.eye = Vec3{40, 9.5, 12.5};
    s.camera.target = Vec3{50, 9.5, 12.5}; // looking away
    EXPECT_EQ(render_one(volume, s).center()[3], 1);
}

TEST(RenderMarch, FarCameraSeesTheSame) {
    Volume volume = blobs({21, 25, 30}, DataType::float32);
    RenderSettings s = orthographic("oblique", 32, 32);
    s.lut = {1, 1, 1, 0, 1, 0.5, 0, 0.4};
    Picture const near = render_one(volume, s);
    Camera const c = near.report.camera;
    Vec3 const way = c.eye - c.target;
    double const length = std::sqrt(way.x * way.x + way.y * way.y + way.z * way.z);
    s.camera.target = c.target;
    s.camera.eye = c.target + way * (1e6 / length);
    EXPECT_LT(greatest_difference(near.image, render_one(volume, s).image), 1e-4);
}

TEST(RenderMarch, ScaleOfWorldAndDataDoNotMatter) {
    Volume volume = blobs({21, 25, 30}, DataType::float32);
    RenderSettings s;
    s.width = s.height = 32;
    s.lut = {1, 1, 1, 0, 1, 0.5, 0, 0.4};
    Picture const one = render_one(volume, s);
    for (double const scale : {1e-9, 1e9}) {
        Volume scaled = volume;
        scaled.header().geometry.spacing = {scale, scale, scale};
        EXPECT_LT(greatest_difference(one.image, render_one(scaled, s).image), 1e-4) << scale;
        Volume valued = volume;
        valued.header().values = {scale, 7 * scale};
        EXPECT_LT(greatest_difference(one.image, render_one(valued, s).image), 1e-4) << scale;
    }
}

// Neither do they for shading, up to sizes whose squares are no floats.
TEST(RenderMarch, ScaleOfWorldAndDataDoNotMatterForShading) {
    Volume const volume = blobs({21, 25, 30}, DataType::float32);
    for (Algorithm const algorithm : {Algorithm::ray_marching, Algorithm::implicit_iso}) {
        RenderSettings s;
        s.width = s.height = 32;
        s.algorithm = algorithm;
        s.shade = 0.9;
        std::vector<unsigned char> const one = to_bytes(render_one(volume, s).image, {});
        s.shade = 0;
        EXPECT_NE(to_bytes(render_one(volume, s).image, {}), one);
        s.shade = 0.9;
        auto const compare = [&](Volume const& other, std::string const& what) {
            std::vector<unsigned char> const bytes = to_bytes(render_one(other, s).image, {});
            int greatest = 0;
            for (std::size_t i = 0; i < bytes.size(); ++i) greatest = std::max(greatest, std::abs(bytes[i] - one[i]));
            EXPECT_LE(greatest, 1) << what << " for algorithm " << static_cast<int>(algorithm);
        };
        for (double const scale : {1e-20, 1e-12, 1e12, 1e20}) {
            Volume world = volume;
            world.header().geometry.spacing = {scale, scale, scale};
            compare(world, text("spacing ", scale));
            Index3 const d = volume.header().dims;
            auto const v = volume.view().as<float>();
            compare(volume_of(d, {1, 1, 1},
                              [&](double x, double y, double z) {
                                  return scale * static_cast<double>(v(std::lround(x), std::lround(y), std::lround(z)));
                              }),
                    text("values ", scale));
        }
    }
}

TEST(RenderMarch, OddShapesWork) {
    for (Index3 const dims : {Index3{1, 1, 1}, Index3{2049, 3, 3}, Index3{1, 40, 7}}) {
        Volume volume = constant_volume(dims, 5.0F, {1, 1, 1});
        RenderSettings s = orthographic("-y", 33, 17);
        s.transfer = flat_transfer({1, 1, 1}, 0.05, 1);
        Picture const picture = render_one(volume, s);
        EXPECT_NEAR(picture.center()[3], std::exp(-extinction_of(0.05) * static_cast<double>(dims.y)), 2e-6);
    }
}

TEST(Lattices, whatIsReadToItsPlaceIsWhatACopyGives) {
    for (DataType const type : {DataType::uint8, DataType::uint16, DataType::int16, DataType::float32})
        for (Index3 const dims : {Index3{13, 9, 11}, Index3{1, 1, 1}, Index3{20, 1, 3}}) {
            Volume const volume = blobs(dims, type);
            auto const read = [&](AnyView const& to) {
                // In two parts, as files come.
                for (Box const& part :
                     {Box{{0, 0, 0}, {dims.x, dims.y, dims.z / 2}}, Box{{0, 0, dims.z / 2}, {dims.x, dims.y, dims.z}}})
                    if (!part.empty()) copy(volume.view().part(part), to.part(part));
            };
            Lattice copy = make_lattice(volume.view(), volume.header().values, {}),
                    own = make_lattice(volume.header(), read, {});
            ASSERT_EQ(own.voxels.bytes(), copy.voxels.bytes());
            EXPECT_EQ(std::memcmp(own.voxels.read(Space::host), copy.voxels.read(Space::host), copy.voxels.bytes()), 0)
                << name_of(type) << dims.x;
            EXPECT_EQ(own.view.type, copy.view.type);
            EXPECT_EQ(own.view.slice, copy.view.slice);
            EXPECT_EQ(own.histogram.bins, copy.histogram.bins);
            EXPECT_EQ(own.cells.highest, copy.cells.highest);
        }
}
