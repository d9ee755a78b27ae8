// Weight tables: rational positions, exact sums, footprints.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/resample_weights.h"

#include <gtest/gtest.h>

namespace vkt {
namespace {

double sum_of_weights(AxisTable const& t, std::int64_t o) {
    double sum = 0;
    for (std::int64_t i = t.start[o]; i < t.start[o + 1]; ++i) sum += t.weight[i];
    return sum;
}

TEST(WeightTable, WeightsSumToTheDivisor) {
    for (ResampleKernel const kernel :
         {ResampleKernel::nearest, ResampleKernel::linear, ResampleKernel::area, ResampleKernel::cubic})
        for (Boundary const boundary : {Boundary::clamp, Boundary::mirror, Boundary::wrap})
            for (auto const& [from, to] :
                 {std::pair<int, int>{7, 3}, {3, 7}, {512, 216}, {1, 5}, {5, 1}, {9, 9}, {2, 1000}}) {
                WeightTable const table(from, to, kernel, boundary);
                AxisTable const t = table.taps(Space::host);
                for (std::int64_t o = 0; o < to; ++o) {
                    if (kernel == ResampleKernel::cubic)
                        EXPECT_NEAR(sum_of_weights(t, o), table.divisor(), 1e-14);
                    else
                        EXPECT_EQ(sum_of_weights(t, o), table.divisor()) << from << " to " << to << " at " << o;
                }
            }
}

TEST(WeightTable, BordersKeepTapsInsideAndSayWhatIsMissing) {
    for (ResampleKernel const kernel : {ResampleKernel::linear, ResampleKernel::cubic})
        for (auto const& [from, to] : {std::pair<int, int>{7, 3}, {3, 7}, {1, 5}, {50, 1}, {3, 2}}) {
            WeightTable const table(from, to, kernel, Boundary::border);
            auto const [low, high] = table.footprint(0, to);
            EXPECT_GE(low, 0);
            EXPECT_LE(high, from);
            // Of the taps that wrap keeps, those in the volume.
            WeightTable const all(from, to, kernel, Boundary::wrap);
            AxisTable const t = table.taps(Space::host), whole = all.taps(Space::host);
            for (std::int64_t o = 0; o < to; ++o) {
                double inside = 0;
                for (std::int64_t i = whole.start[o]; i < whole.start[o + 1]; ++i) {
                    std::int64_t const at = whole.first[o] + i - whole.start[o];
                    if (at >= 0 && at < from) inside += whole.weight[i];
                }
                EXPECT_NEAR(t.inside != nullptr ? t.inside[o] : t.divisor, inside, 1e-14);
            }
        }
}

TEST(WeightTable, ClampAndMirrorStayInside) {
    for (ResampleKernel const kernel :
         {ResampleKernel::nearest, ResampleKernel::linear, ResampleKernel::area, ResampleKernel::cubic})
        for (Boundary const boundary : {Boundary::clamp, Boundary::mirror})
            for (auto const& [from, to] : {std::pair<int, int>{7, 3}, {3, 7}, {1, 5}, {50, 1}, {3, 2}}) {
                WeightTable const table(from, to, kernel, boundary);
                auto const [low, high] = table.footprint(0, to);
                EXPECT_GE(low, 0);
                EXPECT_LE(high, from);
            }
}

TEST(WeightTable, PositionsAreCellCentred) {
    WeightTable const table(4, 8, ResampleKernel::linear, Boundary::clamp);
    AxisTable const t = table.taps(Space::host);
    EXPECT_EQ(t.first[0], 0); // -1/4, folded onto the first voxel
    EXPECT_EQ(t.start[1] - t.start[0], 1);
    EXPECT_EQ(t.first[1], 0); // 1/4
    EXPECT_EQ(t.weight[t.start[1]] / table.divisor(), 0.75);
    EXPECT_EQ(t.pair[2] / table.divisor(), 0.75);
    EXPECT_EQ(t.pair[3] / table.divisor(), 0.25);
}

TEST(WeightTable, KnowsHalvings) {
    EXPECT_EQ(WeightTable(8, 4, ResampleKernel::area, Boundary::clamp).halving(), 2);
    EXPECT_EQ(WeightTable(8, 8, ResampleKernel::area, Boundary::clamp).halving(), 1);
    EXPECT_EQ(WeightTable(9, 4, ResampleKernel::area, Boundary::clamp).halving(), 0);
    EXPECT_EQ(WeightTable(8, 4, ResampleKernel::linear, Boundary::clamp).halving(), 0);
}

TEST(WeightTable, PositionsOfLongLinesAreExact) {
    // (2 o + 1) n / 6 for a prime n near 10^9: far beyond what float32 coordinates tell apart
    std::int64_t const n = 1'000'000'007;
    WeightTable const nearest(n, 3, ResampleKernel::nearest, Boundary::clamp);
    AxisTable const t = nearest.taps(Space::host);
    for (std::int64_t o = 0; o < 3; ++o) EXPECT_EQ(t.first[o], (2 * o + 1) * n / 6);
    WeightTable const linear(n, 3, ResampleKernel::linear, Boundary::clamp);
    EXPECT_EQ(linear.taps(Space::host).first[2], (5 * n - 3) / 6);
}

} // namespace
} // namespace vkt
