// Operations through the library's own interface: what the command line cannot show.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/cut.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/resample/resample.h"
#include "libvkt/operations/statistics/statistics.h"
#include "libvkt/operations/voxels/arithmetic.h"
#include "libvkt/operations/voxels/convert.h"
#include "libvkt/operations/voxels/make.h"
#include "libvkt/operations/voxels/project.h"
#include "tests/unit/volumes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <limits>
#include <random>

namespace vkt {
namespace {

Volume noise(Index3 dims, DataType type) {
    MakeNoise make;
    make.dims = dims;
    make.dtype = type;
    return apply(make, {}, {});
}

TEST(Operations, ResampleDoesNotDependOnHowItsOutputIsCut) {
    Volume const in = noise({23, 19, 17}, DataType::uint16);
    for (ResampleMethod const method :
         {ResampleMethod::automatic, ResampleMethod::linear, ResampleMethod::cubic, ResampleMethod::nearest}) {
        Resample resample;
        resample.dims = Index3{31, 7, 12};
        resample.method = method;
        Volume const whole = apply(resample, {in}, {});
        Header const h = whole.header();
        Volume pieces(h);
        // boxes, not only slabs: every region must come out alike
        for (std::int64_t z = 0; z < 12; z += 5)
            for (std::int64_t y = 0; y < 7; y += 3)
                for (std::int64_t x = 0; x < 31; x += 11) {
                    Box const box = intersect({{x, y, z}, {x + 11, y + 3, z + 5}}, box_of(h.dims));
                    std::vector<ConstView> const inputs{in.view().part(resample.footprint(box, 0))};
                    resample.run(inputs, pieces.mutable_view().part(box), {});
                }
        EXPECT_EQ(std::memcmp(whole.view().data, pieces.view().data, h.bytes()), 0);
    }
}

TEST(Operations, AreaKeepsTheSumOfIntegers) {
    Volume const in = noise({24, 18, 12}, DataType::uint16);
    Resample resample;
    resample.dims = Index3{8, 6, 4};
    resample.dtype = DataType::float64;
    Volume const out = apply(resample, {in}, {});
    std::int64_t want = 0;
    double got = 0;
    for (std::int64_t i = 0; i < in.header().voxels(); ++i) want += in.view().as<std::uint16_t>().data[i];
    for (std::int64_t i = 0; i < out.header().voxels(); ++i) got += out.view().as<double>().data[i];
    EXPECT_NEAR(got * 27, static_cast<double>(want), 1e-9 * static_cast<double>(want));
}

/// What rounds, saturates or gets lost: halves, the ends of every type and around them, NaN and infinities.
std::vector<float> awkward_floats() {
    std::vector<float> values;
    float const infinity = std::numeric_limits<float>::infinity();
    for (float const base :
         {0.0F, 127.0F, 128.0F, 255.0F, 256.0F, 32767.0F, 32768.0F, 65535.0F, 65536.0F, 2147483648.0F})
        for (float const off : {-1.0F, -0.5F, 0.0F, 0.5F, 1.0F})
            for (float const sign : {-1.0F, 1.0F}) {
                float const v = sign * (base + off);
                for (float const w : {v, std::nextafter(v, infinity), std::nextafter(v, -infinity)})
                    values.push_back(w);
            }
    auto at = values.begin() + 21; // where the shortest row that is tried has them
    for (float const v : {std::numeric_limits<float>::quiet_NaN(), infinity, -infinity, 3e38F, -3e38F})
        at = values.insert(at, v) + 3;
    return values;
}

TEST(Operations, NarrowingRoundsSaturatesAndCountsOnEveryInstructionSet) {
    std::vector<float> const values = awkward_floats();
    for (DataType const type : {DataType::uint8, DataType::int8, DataType::uint16, DataType::int16})
        for (float const ordinary : {1.0F, std::numeric_limits<float>::quiet_NaN()}) // rows with and without losses
            for (std::int64_t const length : {7, 64, 1500}) {
                Volume in(header_of({length, 3, 2}, DataType::float32));
                auto* const voxels = reinterpret_cast<float*>(in.mutable_view().data);
                std::int64_t const n = in.header().voxels();
                for (std::int64_t i = 0; i < n; ++i)
                    voxels[i] = i < n / 2 && ordinary == 1.0F ? static_cast<float>(i % 100)
                                                              : values[static_cast<std::size_t>(i) % values.size()];
                double const low = lowest_of(type), high = highest_of(type);
                std::int64_t clipped = 0, lost = 0;
                std::vector<double> expected;
                for (std::int64_t i = 0; i < n; ++i) {
                    double const v = static_cast<double>(voxels[i]), whole = std::nearbyint(v);
                    bool const nan = std::isnan(v);
                    lost += nan ? 1 : 0;
                    clipped += !nan && (whole < low || whole > high) ? 1 : 0;
                    expected.push_back(nan ? 0 : std::clamp(whole, low, high));
                }
                for (InstructionSet const set : {InstructionSet::baseline, best_instruction_set()}) {
                    Execution execution;
                    execution.instructions = set;
                    execution.threads = 2;
                    Convert convert;
                    convert.dtype = type;
                    Volume const out = apply(convert, {in}, execution);
                    ASSERT_EQ(values_of(out), expected) << name_of(type) << ' ' << name_of(set);
                    std::string said;
                    for (Remark const& remark : convert.remarks()) said += remark.message + '\n';
                    ASSERT_NE(said.find(text(clipped, " of ", n)), std::string::npos) << said;
                    ASSERT_NE(said.find(text(lost, " of ", n)), std::string::npos) << said;
                }
            }
}

TEST(Operations, SumsOfSmallIntegersAreExactOnEveryInstructionSet) {
    std::mt19937 random(5);
    for (DataType const type : {DataType::uint8, DataType::int8, DataType::uint16, DataType::int16})
        for (std::int64_t const length : {1, 31, 33, 5000, 40000})
            for (int const kind : {0, 1, 2}) { // random, all least, all greatest
                Volume in(header_of({length, 3, 1}, type));
                std::vector<Int128> voxels;
                with_type(type, [&]<class T>(T) {
                    if constexpr (std::is_integral_v<T>) {
                        auto* const to = reinterpret_cast<T*>(in.mutable_view().data);
                        for (std::int64_t i = 0; i < 3 * length; ++i) {
                            to[i] = kind == 0   ? static_cast<T>(random())
                                    : kind == 1 ? std::numeric_limits<T>::lowest()
                                                : std::numeric_limits<T>::max();
                            voxels.push_back(static_cast<Int128>(to[i]));
                        }
                    }
                });
                Int128 sum = 0, squares = 0;
                for (Int128 const v : voxels) sum += v, squares += v * v;
                auto const n = static_cast<long double>(voxels.size());
                long double const mean = static_cast<long double>(sum) / n;
                long double const variance = static_cast<long double>(squares) / n - mean * mean;
                for (InstructionSet const set : {InstructionSet::baseline, best_instruction_set()}) {
                    Execution execution;
                    execution.instructions = set;
                    Statistics statistics;
                    auto const source = volume_source({in});
                    source->next_volume();
                    reduce(*source, statistics, execution, {});
                    StatisticsResult const& r = statistics.result();
                    ASSERT_EQ(r.sum, static_cast<double>(sum)) << name_of(type) << ' ' << length;
                    ASSERT_NEAR(r.variance, static_cast<double>(variance), 1e-9 * static_cast<double>(squares) / 3);
                    ASSERT_EQ(r.min, static_cast<double>(*std::min_element(voxels.begin(), voxels.end())));
                    ASSERT_EQ(r.max, static_cast<double>(*std::max_element(voxels.begin(), voxels.end())));
                }
            }
}

/// Slices so large that several are read at once, rows with and without a rest, in slabs and on one thread or two.
TEST(Operations, ProjectionsOfLargeSlicesAreThoseOfTheirLines) {
    Index3 const dims{170, 101, 7};
    for (DataType const type :
         {DataType::uint8, DataType::int8, DataType::uint16, DataType::int16, DataType::float32}) {
        Volume in = noise(dims, type);
        if (type == DataType::float32) // what leaves sums that are not finite
            reinterpret_cast<float*>(in.mutable_view().data)[4711] = std::numeric_limits<float>::quiet_NaN();
        std::vector<double> const voxels = values_of(in);
        for (int axis = 0; axis < 3; ++axis) {
            std::int64_t const stride = axis == 0 ? 1 : axis == 1 ? dims.x : dims.x * dims.y;
            std::vector<std::vector<double>> lines;
            for (std::int64_t z = 0; z < (axis == 2 ? 1 : dims.z); ++z)
                for (std::int64_t y = 0; y < (axis == 1 ? 1 : dims.y); ++y)
                    for (std::int64_t x = 0; x < (axis == 0 ? 1 : dims.x); ++x) {
                        std::vector<double>& line = lines.emplace_back();
                        for (std::int64_t k = 0; k < dims[axis]; ++k) {
                            double const v =
                                voxels[static_cast<std::size_t>(x + dims.x * (y + dims.y * z) + k * stride)];
                            if (v == v) line.push_back(v); // NOLINT(misc-redundant-expression): NaN
                        }
                    }
            for (Projection const kind : {Projection::max, Projection::min, Projection::sum, Projection::std})
                for (InstructionSet const set : {InstructionSet::baseline, best_instruction_set()})
                    for (std::int64_t const slab : {0, 3}) {
                        Execution execution;
                        execution.instructions = set;
                        execution.threads = slab == 0 ? 2 : 1;
                        execution.slab = slab;
                        Project project;
                        project.kind = kind;
                        project.axis = static_cast<Axis>(axis);
                        std::vector<double> const got = values_of(apply(project, {in}, execution));
                        ASSERT_EQ(got.size(), lines.size());
                        for (std::size_t i = 0; i < lines.size(); ++i) {
                            std::vector<double> const& line = lines[i];
                            long double sum = 0, squares = 0;
                            for (double const v : line) sum += v;
                            long double const mean = sum / static_cast<long double>(line.size());
                            for (double const v : line) squares += (v - mean) * (v - mean);
                            double const want =
                                kind == Projection::max   ? *std::max_element(line.begin(), line.end())
                                : kind == Projection::min ? *std::min_element(line.begin(), line.end())
                                : kind == Projection::sum
                                    ? static_cast<double>(sum)
                                    : static_cast<double>(std::sqrt(squares / static_cast<long double>(line.size())));
                            double const rounding = kind == Projection::std ? 0x1p-23 : 0x1p-50;
                            double const most = is_integer(type) && kind != Projection::std ? 0 : rounding;
                            ASSERT_NEAR(got[i], want, most * std::abs(want)) << name_of(type) << axis << name_of(set);
                        }
                    }
        }
    }
}

TEST(Operations, StatisticsMergeAsIfTheVolumeWereOne) {
    for (DataType const type : {DataType::float32, DataType::int64, DataType::uint8}) {
        Volume const in = noise({37, 5, 29}, type);
        std::vector<Header> const headers{in.header()};
        std::vector<StatisticsResult> results;
        for (std::int64_t const height : {29, 1, 4}) {
            Statistics statistics;
            begun(statistics, headers);
            for (std::int64_t z = 0; z < 29; z += height)
                statistics.scan(in.view().part(intersect({{0, 0, z}, {37, 5, z + height}}, box_of(in.header().dims))),
                                {});
            statistics.scan_end();
            results.push_back(statistics.result());
        }
        for (auto const& r : results) {
            EXPECT_EQ(r.mean, results.front().mean);
            EXPECT_EQ(r.variance, results.front().variance);
            EXPECT_EQ(r.sum_text, results.front().sum_text);
            EXPECT_EQ(r.argmax, results.front().argmax);
        }
    }
}

TEST(Operations, StatisticsMergePiecesOfSlicesToo) {
    for (DataType const type : {DataType::float32, DataType::int64, DataType::uint8}) {
        Volume const in = noise({37, 700, 3}, type);
        for (bool const part_only : {false, true}) {
            std::vector<Header> const headers{in.header()};
            std::vector<StatisticsResult> results;
            for (std::int64_t const steps : {100, 1, 3}) {
                Statistics statistics;
                if (part_only) statistics.roi = roi_of({2, 13, 1}, {37, 690, 3});
                begun(statistics, headers);
                Box const part = statistics.scanned(box_of(in.header().dims));
                std::int64_t const step = statistics.scan_step(part.dims());
                EXPECT_LT(step, part.dims().y); // or there would be one piece
                for_each_piece(part, {1, steps * step},
                               [&](Box const& piece) { statistics.scan(in.view().part(piece), {}); });
                statistics.scan_end();
                results.push_back(statistics.result());
            }
            for (auto const& r : results) {
                EXPECT_EQ(r.count, results.front().count);
                EXPECT_EQ(r.mean, results.front().mean);
                EXPECT_EQ(r.variance, results.front().variance);
                EXPECT_EQ(r.sum_text, results.front().sum_text);
                EXPECT_EQ(r.argmax, results.front().argmax);
            }
        }
    }
}

TEST(Operations, PromotionTable) {
    EXPECT_EQ(promoted(DataType::uint8, DataType::int8), DataType::int16);
    EXPECT_EQ(promoted(DataType::uint32, DataType::int8), DataType::int64);
    EXPECT_EQ(promoted(DataType::uint64, DataType::uint8), DataType::uint64);
    EXPECT_EQ(promoted(DataType::uint64, DataType::int8), DataType::int64);
    EXPECT_EQ(promoted(DataType::float16, DataType::float32), DataType::float32);
    EXPECT_EQ(promoted(DataType::float16, DataType::uint16), DataType::float32);
    EXPECT_EQ(promoted(DataType::float32, DataType::uint64), DataType::float64);
    for (int a = 0; a < data_type_count; ++a)
        for (int b = 0; b < data_type_count; ++b)
            EXPECT_EQ(promoted(static_cast<DataType>(a), static_cast<DataType>(b)),
                      promoted(static_cast<DataType>(b), static_cast<DataType>(a)));
}

TEST(Operations, BallCoverageOfAVoxel) {
    EXPECT_EQ(ball_coverage({0, 0, 0}, 10), 1);
    EXPECT_EQ(ball_coverage({20, 0, 0}, 10), 0);
    EXPECT_NEAR(ball_coverage({0, 0, 0}, 0.5), M_PI / 6, 1e-7);
    // far from the centre the surface is nearly a plane: half of the voxel, less the cap's sagitta
    EXPECT_NEAR(ball_coverage({1000, 0, 0}, 1000), 0.5, 1e-4);
    EXPECT_NEAR(ball_coverage({-3, 4.5, 1}, 5), ball_coverage({4.5, 1, -3}, 5), 1e-12);
}

} // namespace
} // namespace vkt
