// The smallest type within a tolerance, from what a scan found; parts of a volume joined; the level of noise.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/noise_level.h"
#include "libvkt/operations/voxels/smallest_type.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace vkt {
namespace {

Volume volume_of(std::vector<double> const& values) {
    Header header;
    header.dims = {static_cast<std::int64_t>(values.size()), 1, 1};
    header.dtype = DataType::float64;
    Volume volume(header);
    std::copy(values.begin(), values.end(), reinterpret_cast<double*>(volume.mutable_view().data));
    return volume;
}

TypeFit fit_of(std::vector<double> const& values, int threads = 1) {
    Volume const volume = volume_of(values);
    Execution execution;
    execution.threads = threads;
    TypeFit fit;
    find_fit(volume.view(), fit, execution);
    return fit;
}

Storage smallest(std::vector<double> const& values, double tolerance) {
    return smallest_storage(fit_of(values), volume_of(values).header(), tolerance);
}

TEST(SmallestType, PrefersWhatNeedsNoMap) {
    EXPECT_EQ(smallest({0, 255, 3}, 0).type, DataType::uint8);
    EXPECT_EQ(smallest({-128, 127, 3}, 0).type, DataType::int8);
    EXPECT_FALSE(smallest({0, 255, 3}, 0).maps);
    EXPECT_EQ(smallest({0.25, 0.5, 1.0 / 3}, 0).type, DataType::float64);
    EXPECT_EQ(smallest({0.25, 0.5, 1.0 / 3}, 1e-3).type, DataType::uint8);
}

TEST(SmallestType, CountsInCommonSteps) {
    Storage const found = smallest({-1000, -1000 + 7 * 255.0, -1000 + 7 * 4.0}, 0);
    EXPECT_EQ(found.type, DataType::uint8);
    EXPECT_TRUE(found.maps);
    EXPECT_EQ(found.values.slope, 7);
    EXPECT_EQ(found.values.intercept, -1000);
    EXPECT_EQ(found.codes, 255);
    EXPECT_EQ(found.error, 0);
}

TEST(SmallestType, FloatsAloneHoldWhatIsNoNumber) {
    double const nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
    EXPECT_EQ(smallest({0, nan}, 1e9).type, DataType::float16);
    EXPECT_EQ(smallest({0, infinity, 1e30}, 1e27).type, DataType::float32);
    EXPECT_EQ(smallest({0, infinity, 1e300}, 1e27).type, DataType::float64);
}

TEST(SmallestType, PartsOfAVolumeTellTheSameAsTheWhole) {
    std::mt19937 random(3);
    for (int repeat = 0; repeat < 200; ++repeat) {
        std::vector<double> values;
        double const step = 1 + static_cast<double>(random() % 9);
        std::size_t const n = 2 + random() % 40;
        for (std::size_t i = 0; i < n; ++i)
            values.push_back(step * static_cast<double>(random() % 100) + (repeat % 4 == 0 ? 0.5 : 17));
        auto const cut = values.begin() + static_cast<std::ptrdiff_t>(random() % n);
        TypeFit whole = fit_of(values, 1 + static_cast<int>(random() % 3)), parts;
        for (auto const& part : {std::vector<double>(values.begin(), cut), std::vector<double>(cut, values.end())})
            if (!part.empty()) parts = joined(parts, fit_of(part));
        EXPECT_EQ(whole.step, parts.step) << repeat;
        EXPECT_EQ(whole.extremes.low, parts.extremes.low);
        EXPECT_EQ(whole.extremes.high, parts.extremes.high);
        EXPECT_EQ(whole.off_whole, parts.off_whole);
        EXPECT_EQ(whole.off_half, parts.off_half);
        EXPECT_EQ(whole.off_single, parts.off_single);
    }
}

TEST(NoiseLevel, IsThatOfTheNoiseWhateverLiesBelow) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal(0, 4);
    Header header;
    header.dims = {40, 41, 42};
    header.dtype = DataType::float64;
    Volume volume(header);
    auto* v = reinterpret_cast<double*>(volume.mutable_view().data);
    for (std::int64_t z = 0; z < 42; ++z)
        for (std::int64_t y = 0; y < 41; ++y)
            for (std::int64_t x = 0; x < 40; ++x)
                *v++ = 0.5 * static_cast<double>(x * y) + (z > 20 ? 1000 : 0) + normal(random);
    EXPECT_NEAR(noise_level(volume), 4, 0.2);
    Volume constant(header);
    std::fill_n(reinterpret_cast<double*>(constant.mutable_view().data), header.voxels(), 3.0);
    EXPECT_EQ(noise_level(constant), 0);
}

} // namespace
} // namespace vkt
