// Operations through the library's own interface: what the command line cannot show.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/cut.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/arithmetic.h"
#include "libvkt/operations/make.h"
#include "libvkt/operations/resample.h"
#include "libvkt/operations/statistics.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>

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

TEST(Operations, StatisticsMergeAsIfTheVolumeWereOne) {
    for (DataType const type : {DataType::float32, DataType::int64, DataType::uint8}) {
        Volume const in = noise({37, 5, 29}, type);
        std::vector<Header> const headers{in.header()};
        std::vector<StatisticsResult> results;
        for (std::int64_t const height : {29, 1, 4}) {
            Statistics statistics;
            statistics.plan(headers);
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
                statistics.plan(headers);
                Box const part = statistics.scanned(box_of(in.header().dims));
                std::int64_t const step = statistics.scan_step(part.dims());
                EXPECT_LT(step, 200);
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
