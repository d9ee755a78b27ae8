// Percentiles of groups against sorting, with room for everything and for hardly anything.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/grouped_quantiles.h"

#include "libvkt/core/error.h"
#include "libvkt/core/half.h"
#include "sorted_percentile.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <random>
#include <thread>
#include <vector>

namespace vkt {
namespace {

std::vector<double> const percents{50, 0, 0.1, 99.5, 100, 33};

struct Voxels {
    std::vector<std::uint32_t> groups;
    std::uint32_t count = 0;
};

/// A large group, one of a single value, an empty one, small ones, and voxels of none.
Voxels groups_of(std::size_t n) {
    std::mt19937 random(4);
    Voxels result;
    result.count = 40;
    for (std::size_t i = 0; i < n; ++i) {
        auto const r = static_cast<std::uint32_t>(random() % 100);
        result.groups.push_back(r < 70   ? 0
                                : r < 80 ? 1
                                : r < 85 ? GroupedQuantiles::no_group
                                         : 3 + static_cast<std::uint32_t>(random() % 37));
    }
    return result;
}

template <class T>
std::vector<double> found(std::vector<T> const& values, Voxels const& in, DataType type, std::size_t room, int threads,
                          int& passes) {
    std::vector<std::int64_t> finite(in.count, 0);
    for (std::size_t i = 0; i < values.size(); ++i)
        if (in.groups[i] != GroupedQuantiles::no_group && std::isfinite(static_cast<double>(values[i])))
            ++finite[in.groups[i]];
    GroupedQuantiles q(type, percents, finite);
    passes = 0;
    while (q.unfinished()) {
        q.begin_pass(room, threads);
        ++passes;
        std::vector<std::jthread> crew;
        crew.reserve(static_cast<std::size_t>(q.threads()));
        std::size_t const n = values.size(), share = static_cast<std::size_t>(q.threads());
        for (int t = 0; t < q.threads(); ++t)
            crew.emplace_back([&, t] {
                auto const k = static_cast<std::size_t>(t);
                std::size_t const begin = n * k / share, end = n * (k + 1) / share;
                q.add(reinterpret_cast<std::byte const*>(values.data() + begin), in.groups.data() + begin,
                      static_cast<std::int64_t>(end - begin), t);
            });
        crew.clear();
        q.end_pass();
    }
    std::vector<double> result;
    for (std::size_t g = 0; g < in.count; ++g)
        for (std::size_t i = 0; i < percents.size(); ++i)
            result.push_back(q.count(g) > 0 ? q.percentile(g, i).value() : 4.25);
    return result;
}

template <class T, class Draw> void expect_sorted(DataType type, int most_passes, Draw const& draw) {
    std::size_t const n = 200000;
    Voxels const in = groups_of(n);
    std::mt19937 random(9);
    std::vector<T> values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<T>(in.groups[i] == 1 ? 7 : draw(random));
    int plenty_passes = 0, passes = 0;
    std::vector<double> const all = found(values, in, type, std::size_t{1} << 30, 1, plenty_passes);
    for (std::uint32_t g = 0; g < in.count; ++g) {
        std::vector<double> group; // the values are few enough digits
        for (std::size_t i = 0; i < n; ++i)
            if (auto const v = static_cast<double>(values[i]); in.groups[i] == g && std::isfinite(v))
                group.push_back(v);
        ASSERT_EQ(group.empty(), g == 2);
        for (std::size_t i = 0; i < percents.size(); ++i) {
            double const want = group.empty() ? 4.25 : sorted_percentile(group, percents[i]);
            EXPECT_NEAR(all[g * percents.size() + i], want, std::abs(want) * 1e-15) << g << " " << percents[i];
        }
    }
    EXPECT_LE(plenty_passes, 3);
    for (std::size_t const room : {std::size_t{3} << 20, std::size_t{200000}, std::size_t{60000}})
        for (int const threads : {1, 3}) {
            EXPECT_EQ(found(values, in, type, room, threads, passes), all) << room << " " << threads;
            EXPECT_GE(passes, plenty_passes);
        }
    EXPECT_LE(passes, most_passes);
}

TEST(GroupedQuantiles, AreExactForAllTypesWhateverTheRoom) {
    auto const integer = [](double low, double high) {
        return [=](std::mt19937& r) { return std::floor(std::uniform_real_distribution<double>(low, high)(r)); };
    };
    expect_sorted<std::uint8_t>(DataType::uint8, 2, integer(0, 256));
    expect_sorted<std::int8_t>(DataType::int8, 2, integer(-128, 128));
    expect_sorted<std::uint16_t>(DataType::uint16, 4, integer(0, 65536));
    expect_sorted<std::int16_t>(DataType::int16, 4, integer(-32768, 32768));
    expect_sorted<std::uint32_t>(DataType::uint32, 8, integer(0, 4294967296.0));
    expect_sorted<std::int32_t>(DataType::int32, 8, integer(-2147483648.0, 2147483648.0));
    expect_sorted<std::int64_t>(DataType::int64, 16, integer(-4e15, 4e15));
    auto const odd = [](std::mt19937& r) {
        auto const k = r() % 50;
        return k == 0   ? std::numeric_limits<double>::quiet_NaN()
               : k == 1 ? -std::numeric_limits<double>::infinity()
               : k == 2 ? -0.0
                        : std::normal_distribution<double>(1000, 3)(r);
    };
    expect_sorted<Half>(DataType::float16, 4, [&](std::mt19937& r) { return static_cast<float>(odd(r)); });
    expect_sorted<float>(DataType::float32, 8, odd);
    expect_sorted<double>(DataType::float64, 16, odd);
}

TEST(GroupedQuantiles, RefuseWhatHasNoRoomAndWhatChanged) {
    std::vector<float> const values{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20};
    std::vector<std::uint32_t> const groups(20, 0);
    auto const* const bytes = reinterpret_cast<std::byte const*>(values.data());
    GroupedQuantiles q(DataType::float32, {50}, {20});
    try {
        q.begin_pass(100, 4);
        FAIL();
    } catch (Error const& e) {
        EXPECT_EQ(e.kind(), ErrorKind::resources);
    }
    for (std::int64_t const n : {19, 20}) {
        for (std::size_t const room : {std::size_t{128}, std::size_t{10000}}) { // counters, or the voxels themselves
            GroupedQuantiles other(DataType::float32, {50}, {39 - n});
            other.begin_pass(room, 1);
            other.add(bytes, groups.data(), n, 0);
            EXPECT_THROW(other.end_pass(), Error);
        }
    }
}

} // namespace
} // namespace vkt
