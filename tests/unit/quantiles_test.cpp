// Percentiles against sorting.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/quantiles.h"
#include "sorted_percentile.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <iterator>
#include <random>
#include <vector>

namespace vkt {
namespace {

constexpr double percents[] = {0, 0.1, 1, 25, 37.5, 50, 75, 99, 99.9, 100};

/// The percentiles above, of values added in slabs of some slices and by some threads.
template <class T>
std::vector<double> found(std::vector<T> const& values, DataType type, std::int64_t height = 10, int threads = 2,
                          std::int64_t said = 0) {
    auto const n = static_cast<std::int64_t>(values.size());
    Index3 const dims{n / 20, 2, 10};
    Quantiles q(type, {std::begin(percents), std::end(percents)}, said == 0 ? n : said);
    Execution execution;
    execution.threads = threads;
    int passes = 0;
    do {
        ++passes;
        for (std::int64_t z = 0; z < dims.z; z += height) {
            Box const box{{0, 0, z}, {dims.x, dims.y, std::min(z + height, dims.z)}};
            q.add(dense_view(reinterpret_cast<std::byte const*>(values.data() + z * dims.x * dims.y), type, box),
                  execution);
        }
    } while (q.end_pass());
    EXPECT_LE(passes, 4);
    std::vector<double> result;
    for (std::size_t i = 0; i < std::size(percents); ++i) result.push_back(q.percentile(i).value());
    return result;
}

template <class T> void expect_sorted(std::vector<T> const& values, DataType type) {
    // More voxels than there are keep the counting from being skipped.
    for (std::int64_t const said : {0, 1 << 30}) {
        std::vector<double> const all = found(values, type, 10, 1, said);
        for (std::size_t i = 0; i < all.size(); ++i) {
            double const want = sorted_percentile(values, percents[i]);
            EXPECT_NEAR(all[i], want, std::abs(want) * 1e-15) << percents[i];
        }
        EXPECT_EQ(all, found(values, type, 3, 4, said));
        std::vector<T> reversed(values.rbegin(), values.rend());
        EXPECT_EQ(all, found(reversed, type, 1, 3, said));
    }
}

template <class T> std::vector<T> drawn(std::size_t n, std::function<double(std::mt19937&)> const& draw) {
    std::mt19937 random(1);
    std::vector<T> values(n);
    for (auto& v : values) v = static_cast<T>(draw(random));
    return values;
}

TEST(Quantiles, AreExactForEveryDistribution) {
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> exponent(-700, 700), uniform(-1, 1);
    for (double const offset : {0.0, 1000.0, 1e9}) {
        auto const draw = [&](std::mt19937& r) { return offset + normal(r); };
        expect_sorted(drawn<float>(50000, draw), DataType::float32);
        expect_sorted(drawn<double>(50000, draw), DataType::float64);
    }
    for (double const scale : {1e-300, 1e-60, 1e51, 1.7e308})
        expect_sorted(drawn<double>(50000, [&](std::mt19937& r) { return scale * uniform(r); }), DataType::float64);
    expect_sorted(drawn<double>(50000, [&](std::mt19937& r) { return std::exp(exponent(r)) * (r() % 2 ? 1 : -1); }),
                  DataType::float64);
    auto const few = [](std::mt19937& r) { return static_cast<int>(r() % 11) - 5; };
    expect_sorted(drawn<float>(20000, few), DataType::float32);
    expect_sorted(drawn<std::int8_t>(20000, few), DataType::int8);
    expect_sorted(drawn<std::int16_t>(200000, [](std::mt19937& r) { return static_cast<std::int16_t>(r()); }),
                  DataType::int16);
    expect_sorted(drawn<std::int32_t>(20000, [](std::mt19937& r) { return static_cast<std::int32_t>(r()); }),
                  DataType::int32);
    expect_sorted(drawn<std::uint32_t>(20000, [](std::mt19937& r) { return r(); }), DataType::uint32);
}

TEST(Quantiles, AnOutlierChangesNothingWhereverItIs) {
    std::uniform_real_distribution<double> uniform(0, 1);
    for (double const outlier : {-1e6, -1e30, 1e30}) {
        for (std::size_t const at : {std::size_t{0}, std::size_t{31234}, std::size_t{49999}}) {
            auto values = drawn<double>(50000, [&](std::mt19937& r) { return uniform(r); });
            values[at] = outlier;
            expect_sorted(values, DataType::float64);
        }
    }
}

TEST(Quantiles, MoreVoxelsThanAreKeptAreCounted) {
    std::uniform_real_distribution<double> narrow(1, 1.0001);
    auto const values = drawn<double>(4500000, [&](std::mt19937& r) { return narrow(r); });
    auto const all = found(values, DataType::float64);
    for (std::size_t i = 0; i < all.size(); ++i)
        EXPECT_NEAR(all[i], sorted_percentile(values, percents[i]), 1e-15) << percents[i];
}

TEST(Quantiles, LargeIntegersKeepTheirLastDigits) {
    std::vector<std::int64_t> values(2000);
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = 1700000000000000001 + static_cast<std::int64_t>(i * 7919 % 2000);
    for (std::int64_t const said : {2000, 1 << 30}) {
        Quantiles q(DataType::int64, {0, 50, 100}, said);
        do
            q.add(dense_view(reinterpret_cast<std::byte const*>(values.data()), DataType::int64, box_of({2000, 1, 1})),
                  {});
        while (q.end_pass());
        EXPECT_EQ(q.percentile(0).whole, 1700000000000000001);
        EXPECT_EQ(q.percentile(1) - q.percentile(0), 999.5);
        EXPECT_EQ(q.percentile(2) - q.percentile(0), 1999);
    }
}

TEST(Quantiles, NotANumberDoesNotCount) {
    std::vector<float> values(20, 3.0f);
    values[4] = std::nanf("");
    values[5] = INFINITY;
    Quantiles q(DataType::float32, {50}, 20);
    q.add(dense_view(reinterpret_cast<std::byte const*>(values.data()), DataType::float32, box_of({20, 1, 1})), {});
    EXPECT_FALSE(q.end_pass());
    EXPECT_EQ(q.count(), 18);
    EXPECT_EQ(q.percentile(0).value(), 3);
    Quantiles nothing(DataType::float32, {50}, 20);
    EXPECT_FALSE(nothing.end_pass());
    EXPECT_EQ(nothing.count(), 0);
}

} // namespace
} // namespace vkt
