// The curves of CLAHE against their definition in exact arithmetic.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/clahe.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <vector>

namespace vkt {
namespace {

/// Counts of bins whose sums are whole numbers, as the definition sums them: cut and spread, nothing is rounded but the
/// last quotient, since with these bins, voxels and clips all of it fits 64 bits in units of 1 / bins.
std::vector<double> exact_curve(std::vector<std::uint64_t> const& counts, std::uint64_t cut) {
    auto const n = static_cast<std::uint64_t>(counts.size());
    std::uint64_t const voxels = std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
    std::uint64_t excess = 0, below = 0; // below: in nths of a voxel
    for (std::uint64_t const count : counts) excess += count - std::min(count, cut);
    std::vector<double> curve;
    for (std::uint64_t const count : counts) {
        curve.push_back(static_cast<double>(static_cast<long double>(below) / static_cast<long double>(n * voxels)));
        below += std::min(count, cut) * n + excess;
    }
    curve.push_back(1);
    return curve;
}

std::vector<std::uint64_t> some_counts(std::size_t bins, std::uint64_t most, std::uint64_t voxels, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::vector<std::uint64_t> counts(bins);
    std::uint64_t left = voxels;
    for (std::size_t i = 0; i + 1 < bins; ++i) left -= counts[i] = std::min(left, random() % (most + 1));
    counts.back() = left;
    return counts;
}

TEST(ClaheCurves, AreRoundedAFewTimesHoweverManyBinsThereAre) {
    for (std::size_t const bins : {2U, 3U, 256U, 1000U, 65536U})
        for (std::uint64_t const most : {3ULL, 1000ULL, 1000000ULL}) {
            // So many voxels that a clip of 2 cuts at a whole number.
            std::uint64_t const cut = most / 2 + 1, voxels = cut * bins / 2;
            if (cut * bins % 2 != 0) continue;
            std::vector<std::uint64_t> const counts = some_counts(bins, most, voxels, bins);
            std::vector<double> const curve = clipped_curve(counts, {ClipRule::opencv, 2}),
                                      exact = exact_curve(counts, cut);
            ASSERT_EQ(curve.size(), exact.size());
            double worst = 0;
            for (std::size_t i = 0; i < curve.size(); ++i)
                worst = std::max(worst, std::abs(curve[i] - exact[i]) / std::max(exact[i], 0x1p-60));
            EXPECT_LE(worst, 6 * 0x1p-53) << bins << " bins of up to " << most;
        }
}

TEST(ClaheCurves, NeverFall) {
    std::mt19937 random(3);
    for (int round = 0; round < 200; ++round) {
        std::size_t const bins = 2 + random() % 500;
        std::uint64_t const most = std::uint64_t{1} << random() % 50;
        std::vector<std::uint64_t> const counts = some_counts(bins, most, most * bins / 3, random());
        for (ClipRule const rule : {ClipRule::opencv, ClipRule::skimage, ClipRule::volkit, ClipRule::pizer})
            for (double const clip : {1e-9, 0.01, 0.3, 1.0, 1.7, 40.0, HUGE_VAL}) {
                std::vector<double> const curve = clipped_curve(counts, {rule, clip});
                ASSERT_EQ(curve.front(), 0);
                ASSERT_EQ(curve.back(), 1);
                ASSERT_TRUE(std::is_sorted(curve.begin(), curve.end())) << bins << " bins, clip " << clip;
            }
    }
}

} // namespace
} // namespace vkt
