// Kernels behind SSIM and mutual information: pieces that GPUs work on in other shapes than CPUs, and the edges of
// bins.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/joint_counts.h"
#include "libvkt/operations/statistics/kernels/physical_values.h"
#include "libvkt/operations/statistics/kernels/similarity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace vkt {
namespace {

std::vector<float> noise(std::int64_t count, unsigned seed) {
    std::mt19937 random(seed);
    std::vector<float> values(static_cast<std::size_t>(count));
    for (float& v : values) v = static_cast<float>(random() % 10007) / 100;
    return values;
}

TEST(Similarity, ALongRowHasTheSumsOfItsSegments) {
    Index3 const radius{5, 5, 5}, dims{2 * 5 + 77, 2 * 5 + 4, 2 * 5 + 3};
    Box const whole{Index3{} - radius, dims - radius}, inner{{0, 0, 0}, dims - radius - radius};
    std::vector<float> const a = noise(whole.voxels(), 1), b = noise(whole.voxels(), 2);
    auto const view = [&](std::vector<float> const& values) {
        return ConstView(
            dense_view(reinterpret_cast<std::byte const*>(values.data()), DataType::float32, whole, Space::host));
    };
    Execution execution;
    std::vector<double> planes(static_cast<std::size_t>(5 * inner.dims().x * inner.dims().y * dims.z));
    auto const sums = [&](Box const& part) {
        WindowedPair const pair{
            view(a), view(b), {0.5, 3}, {},           part, radius, {0.26, 0.21, 0.11, 0.04, 0.008, 0.002},
            17,      1,       9,        planes.data()};
        Index3 const n = part.dims();
        std::vector<double> rows(static_cast<std::size_t>((n.x + 31) / 32 * n.y * n.z));
        similarity_rows(pair, rows.data(), execution);
        return rows;
    };
    std::vector<double> const all = sums(inner);
    std::int64_t const segments = 3;
    for (std::int64_t s = 0; s < segments; ++s) {
        Box part = inner;
        part.lower.x = 32 * s;
        part.upper.x = std::min(inner.upper.x, 32 * (s + 1));
        std::vector<double> const some = sums(part);
        for (std::size_t row = 0; row < some.size(); ++row) {
            EXPECT_EQ(some[row], all[row * segments + static_cast<std::size_t>(s)]);
            EXPECT_LT(std::abs(some[row]), static_cast<double>(part.dims().x));
        }
    }
}

TEST(Similarity, BinsAreThoseBetweenTheirEdges) {
    double const infinity = std::numeric_limits<double>::infinity();
    std::vector<double> const edges{-1, -0.25, 0.5, 1.25, 2};
    // The guess is corrected, however wrong it is.
    for (double const scale : {4 / 3.0, 0.0, 1.0, 100.0, 1e300, infinity}) {
        EqualBins const bins{edges.data(), 4, scale};
        std::pair<double, int> const wanted[] = {{-1, 0},  {-0.26, 0},  {-0.25, 1}, {0.4999, 1},
                                                 {0.5, 2}, {1.2499, 2}, {1.25, 3},  {2, 3}};
        for (auto const& [value, bin] : wanted) EXPECT_EQ(baseline::bin_in(bins, value), bin) << value << " " << scale;
    }
}

TEST(Similarity, PairsOfNumbersAreCounted) {
    double const infinity = std::numeric_limits<double>::infinity();
    std::vector<double> const a{0, 1, 2, std::nan(""), 3, infinity, 1}, b{5, 5, 6, 7, std::nan(""), 8, 6};
    Box const box = box_of({7, 1, 1});
    auto const view = [&](std::vector<double> const& values) {
        return ConstView(
            dense_view(reinterpret_cast<std::byte const*>(values.data()), DataType::float64, box, Space::host));
    };
    SlabPair const pair{view(a), view(b), {2, 1}, {}};
    PairRange range{{infinity, infinity}, {-infinity, -infinity}};
    range_of_pairs(pair, range, {});
    EXPECT_EQ(range.low[0], 1);
    EXPECT_EQ(range.high[0], 5);
    EXPECT_EQ(range.low[1], 5);
    EXPECT_EQ(range.high[1], 6);
    std::vector<double> const edges_a{1, 3, 5}, edges_b{5, 5.5, 6};
    std::vector<std::uint64_t> counts(4);
    count_pairs(pair, {edges_a.data(), 2, 0.5}, {edges_b.data(), 2, 2}, counts.data(), {});
    EXPECT_EQ(counts, (std::vector<std::uint64_t>{1, 0, 1, 2}));
}

} // namespace
} // namespace vkt
