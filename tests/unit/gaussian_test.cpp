// Gaussian against a direct sum in double, and the properties that numerics.md section 6 asks for (tests 26 to 43).
// SPDX-License-Identifier: MIT
#include "libvkt/core/half.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/filter/gaussian.h"
#include "tests/unit/volumes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace vkt {
namespace {

Execution with(int threads, std::int64_t slab = 0, InstructionSet set = best_instruction_set()) {
    Execution execution;
    execution.threads = threads;
    execution.slab = slab;
    execution.instructions = set;
    return execution;
}

Gaussian gaussian(Vec3 sigma, Boundary boundary = Boundary::mirror, double tolerance = 0) {
    Gaussian operation(sigma, boundary);
    if (tolerance > 0) operation.set_tolerance(tolerance);
    return operation;
}

/// The infinite sampled kernel, cut where nothing is left in double, applied along one axis by definition.
std::vector<double> convolved(std::vector<double> const& in, Index3 n, int axis, double sigma, Boundary boundary) {
    if (sigma == 0) return in;
    auto const reach = static_cast<std::int64_t>(std::ceil(9 * sigma));
    double mass = 0;
    std::vector<double> kernel;
    for (std::int64_t k = -reach; k <= reach; ++k) {
        kernel.push_back(std::exp(-0.5 * static_cast<double>(k * k) / (sigma * sigma)));
        mass += kernel.back();
    }
    std::vector<double> out(in.size());
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                Index3 p{x, y, z};
                std::int64_t const at = p[axis];
                double sum = 0;
                for (std::int64_t k = -reach; k <= reach; ++k) {
                    p[axis] = fold(at + k, n[axis], boundary);
                    if (p[axis] < 0) continue; // border value 0
                    sum += kernel[static_cast<std::size_t>(k + reach)] *
                           in[static_cast<std::size_t>((p.z * n.y + p.y) * n.x + p.x)];
                }
                out[static_cast<std::size_t>((z * n.y + y) * n.x + x)] = sum / mass;
            }
    return out;
}

std::vector<double> reference(Volume const& volume, Vec3 sigma, Boundary boundary) {
    std::vector<double> values = values_of(volume);
    for (int axis = 0; axis < 3; ++axis) values = convolved(values, volume.header().dims, axis, sigma[axis], boundary);
    return values;
}

TEST(Gaussian, MeetsItsBoundForAllTypesAndBoundaries) {
    Vec3 const sigma{1.3, 0.7, 2.1};
    for (int t = 0; t < data_type_count; ++t)
        for (Boundary boundary : {Boundary::mirror, Boundary::clamp, Boundary::wrap, Boundary::border}) {
            auto const type = static_cast<DataType>(t);
            Volume const in = noise_volume({23, 17, 14}, type, 5);
            Gaussian operation = gaussian(sigma, boundary);
            Plan const plan = operation.plan(std::vector<Header>{in.header()});
            Volume const out = apply(operation, {in}, with(2));
            std::vector<double> const expected = reference(in, sigma, boundary), got = values_of(out),
                                      from = values_of(in);
            double const range = *std::max_element(from.begin(), from.end()) -
                                 std::min(0.0, *std::min_element(from.begin(), from.end()));
            double const largest =
                std::max(*std::max_element(from.begin(), from.end()), -*std::min_element(from.begin(), from.end()));
            double const step = is_integer(type) ? 0.5 : 0.0;
            double worst = 0;
            for (std::size_t i = 0; i < got.size(); ++i) worst = std::max(worst, std::abs(got[i] - expected[i]));
            EXPECT_LE(worst, plan.error.over(range, largest) + step) << name_of(type) << " " << enum_name(boundary);
            EXPECT_LE(plan.error.range, is_integer(type) ? 1e-3 : 1e-4);
            EXPECT_LE(plan.error.magnitude, type == DataType::float16 ? 0x1p-10 : 1e-6);
        }
}

TEST(Gaussian, ToleranceIsKeptAndAttained) {
    for (double tolerance : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10}) {
        // The worst input for the last voxel: 1 where the truncated kernel is too heavy, 0 where it is too light.
        Volume in(header_of({201, 1, 1}, DataType::float64));
        Gaussian operation = gaussian({4, 0, 0}, Boundary::mirror, tolerance);
        Plan const plan = operation.plan(std::vector<Header>{in.header()});
        double const bound = plan.error.over(1, 1);
        EXPECT_LE(bound, tolerance);
        auto const radius = static_cast<std::int64_t>((plan.cost - 1) / 2);
        auto* const values = reinterpret_cast<double*>(in.mutable_view().data);
        for (std::int64_t x = 0; x < 201; ++x) values[x] = std::abs(x - 100) <= radius ? 1 : 0;
        double const error =
            std::abs(values_of(apply(operation, {in}, with(1)))[100] - reference(in, {4, 0, 0}, Boundary::mirror)[100]);
        EXPECT_LE(error, bound);
        EXPECT_GE(error, 0.9 * (bound - 1e-14)) << tolerance;
    }
}

TEST(Gaussian, ReproducesConstantsBitForBit) {
    auto check = [](auto value, DataType type) {
        for (double sigma : {0.3, 0.5, 1.0, 3.3, 26.0, 27.0, 32.0, 300.0}) {
            Volume in(header_of({19, 7, 11}, type));
            auto* const from = reinterpret_cast<decltype(value)*>(in.mutable_view().data);
            std::fill(from, from + 19 * 7 * 11, value);
            Gaussian operation = gaussian({sigma, sigma, sigma});
            for (InstructionSet set : {InstructionSet::baseline, best_instruction_set()})
                EXPECT_TRUE(same_voxels(apply(operation, {in}, with(2, 0, set)), in)) << sigma << " " << name_of(type);
        }
    };
    check(0.1f, DataType::float32);
    check(1e30f, DataType::float32);
    check(3.4028235e38f, DataType::float32);
    check(0.1, DataType::float64);
    check(std::uint8_t{200}, DataType::uint8);
    check(std::uint16_t{65535}, DataType::uint16);
    check(std::int16_t{-32768}, DataType::int16);
    check(std::int32_t{-2147483647}, DataType::int32);
}

TEST(Gaussian, ZeroAndTinySigmaAreTheIdentity) {
    for (double sigma : {0.0, 1e-3, 1e-300}) {
        Volume const in = noise_volume({20, 9, 5}, DataType::float32, 1);
        Gaussian operation = gaussian({sigma, sigma, sigma});
        EXPECT_TRUE(same_voxels(apply(operation, {in}, with(1)), in)) << sigma;
    }
    double const nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    for (double sigma : {-1.0, nan, inf}) EXPECT_THROW(gaussian({1, sigma, 1}).check(), Error);
}

TEST(Gaussian, SigmaBeyondTheVolumeGivesTheMean) {
    for (double factor : {0.5, 1.0, 10.0, 1e6}) {
        Volume const in = noise_volume({16, 12, 9}, DataType::float32, 2);
        Gaussian operation = gaussian({16 * factor, 12 * factor, 9 * factor});
        std::vector<double> const got = values_of(apply(operation, {in}, with(2))), from = values_of(in);
        if (factor >= 10) {
            double mean = 0;
            for (double v : from) mean += v / static_cast<double>(from.size());
            for (double v : got) ASSERT_NEAR(v, mean, 1e-5 * 100);
        } else {
            std::vector<double> const expected =
                reference(in, {16 * factor, 12 * factor, 9 * factor}, Boundary::mirror);
            for (std::size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], expected[i], 1e-4);
        }
    }
}

TEST(Gaussian, FoldedKernelsFollowEveryBoundary) {
    for (Boundary boundary : {Boundary::mirror, Boundary::clamp, Boundary::wrap, Boundary::border})
        for (Index3 dims : {Index3{64, 64, 1}, Index3{1, 1, 1}, Index3{2, 3, 4}, Index3{5, 30, 2}}) {
            Volume const in = noise_volume(dims, DataType::float64, 3);
            Gaussian operation = gaussian({5, 5, 5}, boundary, 1e-9);
            std::vector<double> const got = values_of(apply(operation, {in}, with(2)));
            std::vector<double> const expected = reference(in, {5, 5, 5}, boundary);
            for (std::size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], expected[i], 1e-7) << enum_name(boundary);
        }
}

TEST(Gaussian, ResultsDoNotDependOnCuttingOrThreads) {
    for (DataType type : {DataType::float32, DataType::uint8, DataType::int32})
        for (Boundary boundary : {Boundary::mirror, Boundary::wrap, Boundary::border})
            for (double sigma : {1.5, 6.0}) {
                Volume const in = noise_volume({150, 70, 40}, type, 4);
                Gaussian operation = gaussian({sigma, sigma / 2, sigma}, boundary);
                Volume const whole = apply(operation, {in}, with(1, 40));
                for (std::int64_t slab : {1, 2, 7})
                    for (int threads : {1, 2, 5})
                        ASSERT_TRUE(same_voxels(apply(operation, {in}, with(threads, slab)), whole))
                            << slab << " " << threads;
                // A part asked for on its own, out of order.
                Box const part{{31, 5, 11}, {140, 66, 29}};
                Volume cut(header_of(part.dims(), type));
                begun(operation, std::vector<Header>{in.header()});
                ConstView const window =
                    in.view().part(intersect(operation.footprint(part, 0), box_of(in.header().dims)));
                if (!(window.box == operation.footprint(part, 0))) continue; // wraps in z: the engine's part
                operation.run({&window, 1}, cut.mutable_view().moved_to(part.lower), with(2));
                for (std::int64_t z = 11; z < 29; ++z)
                    for (std::int64_t y = 5; y < 66; ++y)
                        ASSERT_EQ(std::memcmp(whole.view().at(31, y, z), cut.view().at(0, y - 5, z - 11),
                                              109 * size_of(type)),
                                  0);
            }
}

TEST(Gaussian, NanAndInfinityStayWithinTheKernel) {
    for (float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        Volume in = noise_volume({60, 50, 40}, DataType::float32, 6);
        *reinterpret_cast<float*>(in.mutable_view().at(30, 20, 25)) = bad;
        Gaussian operation = gaussian({2, 1, 1.5});
        begun(operation, std::vector<Header>{in.header()});
        Box const box = operation.footprint({{30, 20, 25}, {31, 21, 26}}, 0);
        Volume const out = apply(operation, {in}, with(2));
        for (std::int64_t z = 0; z < 40; ++z)
            for (std::int64_t y = 0; y < 50; ++y)
                for (std::int64_t x = 0; x < 60; ++x) {
                    bool const finite = std::isfinite(*reinterpret_cast<float const*>(out.view().at(x, y, z)));
                    ASSERT_EQ(finite, !box.contains({{x, y, z}, {x + 1, y + 1, z + 1}})) << x << " " << y << " " << z;
                }
    }
}

TEST(Gaussian, ImpulseIsTheKernelAndSymmetric) {
    Volume in(header_of({65, 65, 65}, DataType::float32));
    std::memset(in.mutable_view().data, 0, in.view().bytes());
    *reinterpret_cast<float*>(in.mutable_view().at(32, 32, 32)) = 1;
    Gaussian operation = gaussian({4, 4, 4});
    operation.set_method(GaussianMethod::fir); // the cascade's lattice begins at voxel 0
    std::vector<double> const got = values_of(apply(operation, {in}, with(2))),
                              expected = reference(in, {4, 4, 4}, Boundary::mirror);
    auto at = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
        return got[static_cast<std::size_t>((z * 65 + y) * 65 + x)];
    };
    for (std::size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], expected[i], 1e-4);
    for (std::int64_t z = 0; z < 65; ++z)
        for (std::int64_t y = 0; y < 65; ++y)
            for (std::int64_t x = 0; x < 65; ++x) {
                ASSERT_EQ(at(x, y, z), at(64 - x, y, z));
                ASSERT_EQ(at(x, y, z), at(x, 64 - y, z));
                ASSERT_EQ(at(x, y, z), at(x, y, 64 - z));
                ASSERT_NEAR(at(x, y, z), at(y, z, x), 1e-9); // products in another order
                ASSERT_NEAR(at(x, y, z), at(y, x, z), 1e-9);
            }
}

TEST(Gaussian, KeepsTheSumAndTheRange) {
    Volume const in = noise_volume({40, 30, 20}, DataType::float32, 7);
    Gaussian operation = gaussian({3, 3, 3});
    std::vector<double> const got = values_of(apply(operation, {in}, with(2))), from = values_of(in);
    double a = 0, b = 0;
    for (std::size_t i = 0; i < got.size(); ++i) {
        a += from[i];
        b += got[i];
    }
    EXPECT_NEAR(a, b, 1e-6 * a);
    EXPECT_GE(*std::min_element(got.begin(), got.end()), *std::min_element(from.begin(), from.end()));
    EXPECT_LE(*std::max_element(got.begin(), got.end()), *std::max_element(from.begin(), from.end()));
}

TEST(Gaussian, QuadraticFieldRisesBySigmaSquared) {
    Volume in(header_of({81, 3, 3}, DataType::float64));
    auto* const values = reinterpret_cast<double*>(in.mutable_view().data);
    for (std::int64_t i = 0; i < 81 * 9; ++i) values[i] = static_cast<double>((i % 81 - 40) * (i % 81 - 40));
    Gaussian operation = gaussian({3, 0, 0}, Boundary::mirror, 1e-9);
    EXPECT_NEAR(values_of(apply(operation, {in}, with(1)))[40], 9, 1e-3);
}

TEST(Gaussian, SemigroupAndOffsetInvariance) {
    Volume const in = noise_volume({64, 40, 33}, DataType::float32, 8);
    Gaussian three = gaussian({3, 3, 3}), four = gaussian({4, 4, 4}), five = gaussian({5, 5, 5});
    std::vector<double> const twice = values_of(apply(four, {apply(three, {in}, with(2))}, with(2)));
    std::vector<double> const once = values_of(apply(five, {in}, with(2)));
    for (std::size_t i = 0; i < once.size(); ++i) ASSERT_NEAR(once[i], twice[i], 100 * 4e-4);

    Volume raised = noise_volume({64, 40, 33}, DataType::float32, 8);
    auto* const values = reinterpret_cast<float*>(raised.mutable_view().data);
    for (std::size_t i = 0; i < once.size(); ++i) values[i] += 1000;
    std::vector<double> const up = values_of(apply(five, {raised}, with(2)));
    for (std::size_t i = 0; i < once.size(); ++i) ASSERT_NEAR(up[i] - 1000, once[i], 3e-4); // an ulp is 1.2e-4 there
}

TEST(Gaussian, SmallIntegersAreRoundedCorrectly) {
    Volume const in = noise_volume({50, 40, 30}, DataType::uint8, 9);
    for (double sigma : {1.0, 2.0, 4.0}) {
        Gaussian operation = gaussian({sigma, sigma, sigma});
        std::vector<double> const got = values_of(apply(operation, {in}, with(2))),
                                  exact = reference(in, {sigma, sigma, sigma}, Boundary::mirror);
        double bias = 0, worst = 0, differ = 0;
        for (std::size_t i = 0; i < got.size(); ++i) {
            bias += (got[i] - exact[i]) / static_cast<double>(got.size());
            worst = std::max(worst, std::abs(got[i] - exact[i]));
            differ += got[i] != std::nearbyint(exact[i]) ? 1 : 0;
        }
        EXPECT_LE(std::abs(bias), 0.01);
        EXPECT_LE(worst, 0.5 + 0.25 * 100 / 255); // correct rounding plus the quarter bit allowed
        EXPECT_LE(differ / static_cast<double>(got.size()), 5e-3);
    }
}

TEST(Gaussian, InstructionSetsAgreeWithinTheBound) {
    Volume const in = noise_volume({70, 33, 21}, DataType::float32, 10);
    Gaussian operation = gaussian({2, 2, 2});
    std::vector<double> const base = values_of(apply(operation, {in}, with(1, 0, InstructionSet::baseline)));
    for (InstructionSet set : {InstructionSet::avx2, InstructionSet::avx512}) {
        if (set > best_instruction_set()) continue;
        std::vector<double> const got = values_of(apply(operation, {in}, with(2, 0, set)));
        for (std::size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], base[i], 100 * 2e-6);
    }
}

TEST(Gaussian, WorldUnitsFollowTheSpacing) {
    Volume in = noise_volume({30, 20, 10}, DataType::float32, 11);
    in.header().geometry.spacing = {0.5, 1, 2};
    Parameters parameters;
    Gaussian world, voxel = gaussian({4, 2, 1});
    world.parameters(parameters);
    parameters.set("sigma", {"2"});
    parameters.set("unit", {"world"});
    EXPECT_TRUE(same_voxels(apply(world, {in}, with(1)), apply(voxel, {in}, with(1))));
}

} // namespace
} // namespace vkt
