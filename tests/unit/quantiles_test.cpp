// Percentiles from counters against sorting.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/quantiles.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace vkt {
namespace {

template <class T> double sorted_percentile(std::vector<T> values, double percent) {
    std::sort(values.begin(), values.end());
    double const position = percent / 100 * static_cast<double>(values.size() - 1);
    auto const i = static_cast<std::size_t>(position);
    if (i + 1 == values.size()) return static_cast<double>(values[i]);
    auto const a = static_cast<double>(values[i]), b = static_cast<double>(values[i + 1]);
    return a + (position - static_cast<double>(i)) * (b - a);
}

template <class T> Quantiles counted(std::vector<T> const& values, DataType type) {
    Quantiles q(type);
    auto const n = static_cast<std::int64_t>(values.size());
    q.add(dense_view(reinterpret_cast<std::byte const*>(values.data()), type, {{0, 0, 0}, {n / 10, 5, 2}}), 2);
    return q;
}

TEST(Quantiles, SmallIntegersAreExact) {
    std::mt19937 random(1);
    std::vector<std::int16_t> values(20000);
    for (auto& v : values) v = static_cast<std::int16_t>(random());
    Quantiles const q = counted(values, DataType::int16);
    for (double const p : {0.0, 0.1, 1.0, 37.5, 50.0, 99.9, 100.0})
        EXPECT_NEAR(q.percentile(p), sorted_percentile(values, p), 1e-9) << p;
}

TEST(Quantiles, FloatsWithAnOffsetAreNear) {
    std::mt19937 random(2);
    std::normal_distribution<double> normal(0, 1);
    for (double const offset : {0.0, 1000.0, 1e9}) {
        std::vector<double> values(50000);
        for (auto& v : values) v = offset + normal(random);
        Quantiles const q = counted(values, DataType::float64);
        for (double const p : {0.0, 1.0, 50.0, 99.0, 100.0})
            EXPECT_NEAR(q.percentile(p), sorted_percentile(values, p), 1e-3) << offset << " " << p;
    }
}

TEST(Quantiles, WildlySpreadValuesStayWithinAShare) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> exponent(-30, 30);
    std::vector<float> values(100000);
    for (auto& v : values) v = std::exp(exponent(random)) * (random() % 2 == 0 ? 1.0f : -1.0f);
    Quantiles const q = counted(values, DataType::float32);
    for (double const p : {1.0, 10.0, 90.0, 99.0}) {
        double const want = sorted_percentile(values, p);
        EXPECT_NEAR(q.percentile(p) / want, 1, 2e-3) << p;
    }
}

TEST(Quantiles, ValuesBeyondFloat32AreToldApart) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (double const scale : {1e-300, 1e-60, 1e51, 1.7e308}) {
        std::vector<double> values(50000);
        for (auto& v : values) v = scale * uniform(random);
        Quantiles const q = counted(values, DataType::float64);
        for (double const p : {0.0, 1.0, 25.0, 75.0, 99.0, 100.0})
            EXPECT_NEAR(q.percentile(p) / scale, sorted_percentile(values, p) / scale, 1e-3) << scale << " " << p;
    }
}

TEST(Quantiles, FewWholeNumbersAreExact) {
    std::mt19937 random(5);
    std::vector<float> values(20000);
    for (auto& v : values) v = static_cast<float>(static_cast<int>(random() % 11) - 5);
    Quantiles const q = counted(values, DataType::float32);
    for (double const p : {0.0, 1.0, 37.5, 50.0, 99.0, 100.0})
        EXPECT_NEAR(q.percentile(p), sorted_percentile(values, p), 1e-9) << p;
}

TEST(Quantiles, NotANumberDoesNotCount) {
    std::vector<float> values(20, 3.0f);
    values[4] = std::nanf("");
    values[5] = INFINITY;
    Quantiles const q = counted(values, DataType::float32);
    EXPECT_EQ(q.count(), 18);
    EXPECT_EQ(q.percentile(50), 3);
    EXPECT_TRUE(std::isnan(Quantiles(DataType::float32).percentile(50)));
}

} // namespace
} // namespace vkt
