// The neighbourhood drivers against plain loops: every radius, rows around the width of registers, views with gaps.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/network.h"
#include "libvkt/kernel/stencil.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace vkt {
namespace {

/// Sums all of a window, each neighbour with a weight of its own.
struct WeighAll {
    int rx, ry, rz;
    template <class W> typename W::Value operator()(W const& window) const {
        typename W::Value sum{};
        int weight = 1;
        for (int dz = -rz; dz <= rz; ++dz)
            for (int dy = -ry; dy <= ry; ++dy)
                for (int dx = -rx; dx <= rx; ++dx)
                    sum = sum + window(dx, dy, dz) * (typename W::Value{} + static_cast<float>(weight++ % 7));
        return sum;
    }
};

/// The same in two steps: sums of columns, each with the weight of its dx.
struct WeighColumns {
    static constexpr int columns = 1;
    int rx, ry, rz;
    template <class W, class V> void column(W const& window, V* sums) const {
        sums[0] = V{};
        for (int dz = -rz; dz <= rz; ++dz)
            for (int dy = -ry; dy <= ry; ++dy) sums[0] = sums[0] + window(0, dy, dz);
    }
    template <class W> typename W::Value combine(W const& sums) const {
        typename W::Value sum{};
        for (int dx = -rx; dx <= rx; ++dx)
            sum = sum + sums(dx, 0) * (typename W::Value{} + static_cast<float>(dx + rx + 1));
        return sum;
    }
};

/// Whole numbers with gaps after each row and slice, where `out` must not write.
struct Gapped {
    std::vector<float> values;
    Box box;
    std::int64_t row, slice;

    Gapped(Box const& of, std::uint32_t seed) : box(of) {
        row = of.dims().x + 5;
        slice = row * (of.dims().y + 2);
        values.assign(static_cast<std::size_t>(slice * of.dims().z), -1);
        std::mt19937 random(seed);
        if (seed != 0)
            for (float& v : values) v = static_cast<float>(random() % 32);
    }
    AnyView view() { return {reinterpret_cast<std::byte*>(values.data()), DataType::float32, box, row, slice}; }
    float at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return values[static_cast<std::size_t>((x - box.lower.x) + (y - box.lower.y) * row +
                                               (z - box.lower.z) * slice)];
    }
};

TEST(Stencil, EveryRadiusRowLengthAndViewIsWhatLoopsGive) {
    std::vector<Index3> const radii{{0, 0, 0}, {1, 1, 1}, {2, 1, 0}, {0, 3, 1}, {5, 0, 2}, {17, 1, 1}, {0, 0, 4}};
    std::vector<std::int64_t> const lengths{1, 3, 7, 8, 9, 15, 16, 17, 31, 33, 64, 65, 1023, 1024, 1025, 2050};
    for (Index3 const r : radii)
        for (std::int64_t const n : lengths) {
            Index3 const lower{-3, 100, 7};
            Box const box{lower, lower + (n > 1000 ? Index3{n, 3, 2} : Index3{n, 11, 5})};
            Gapped in({box.lower - r, box.upper + r}, 7), out(box, 0), columns(box, 0);
            Losses losses;
            Execution execution;
            execution.threads = 3;
            int const rx = static_cast<int>(r.x), ry = static_cast<int>(r.y), rz = static_cast<int>(r.z);
            baseline::stencil<float>(execution, out.view(), losses, r, WeighAll{rx, ry, rz}, in.view());
            baseline::column_stencil<float>(execution, columns.view(), losses, r, WeighColumns{rx, ry, rz}, in.view());
            for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
                for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                    for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
                        float sum = 0, by_column = 0;
                        int weight = 1;
                        for (int dz = -rz; dz <= rz; ++dz)
                            for (int dy = -ry; dy <= ry; ++dy)
                                for (int dx = -rx; dx <= rx; ++dx) {
                                    float const v = in.at(x + dx, y + dy, z + dz);
                                    sum += v * static_cast<float>(weight++ % 7);
                                    by_column += v * static_cast<float>(dx + rx + 1);
                                }
                        ASSERT_EQ(out.at(x, y, z), sum) << n << " radius " << rx << ',' << ry << ',' << rz;
                        ASSERT_EQ(columns.at(x, y, z), by_column) << n << " radius " << rx << ',' << ry << ',' << rz;
                    }
            for (Gapped const* gapped : {&out, &columns}) {
                auto const gaps = static_cast<std::ptrdiff_t>(gapped->values.size()) - box.voxels();
                EXPECT_EQ(std::count(gapped->values.begin(), gapped->values.end(), -1.0f), gaps);
            }
        }
}

TEST(Stencil, NothingIsDoneForAnEmptyBox) {
    Losses losses;
    float value = 3;
    AnyView const none{reinterpret_cast<std::byte*>(&value), DataType::float32, {{0, 0, 0}, {0, 4, 4}}, 0, 0};
    baseline::stencil<float>(Execution{}, none, losses, {1, 1, 1}, WeighAll{1, 1, 1}, none);
    EXPECT_EQ(value, 3);
}

template <int lists, int n> void expect_median() {
    std::mt19937 random(5);
    for (int repeat = 0; repeat < 200; ++repeat) {
        std::vector<int> values(static_cast<std::size_t>(lists * n));
        for (int& v : values) v = static_cast<int>(random() % (repeat % 2 == 0 ? 4 : 1000));
        std::vector<int> sorted = values;
        std::sort(sorted.begin(), sorted.end());
        for (int list = 0; list < lists; ++list) {
            baseline::apply_network<baseline::SortingNetwork<n>>(values.data() + list * n);
            ASSERT_TRUE(std::is_sorted(values.begin() + list * n, values.begin() + (list + 1) * n));
        }
        baseline::apply_network<baseline::MedianOfSorted<lists, n>>(values.data());
        ASSERT_EQ(values[static_cast<std::size_t>(baseline::MedianOfSorted<lists, n>::place)],
                  sorted[sorted.size() / 2]);
    }
}

TEST(Network, SortsAndSelectsTheMedian) {
    expect_median<3, 3>();
    expect_median<3, 9>();
    expect_median<5, 5>();
    expect_median<5, 25>();
    // As few steps as the literature has, within a few.
    EXPECT_LE((baseline::SortingNetwork<9>::network.count), 28);
    EXPECT_LE((baseline::SortingNetwork<25>::network.count), 140);
}

template <class T, class K> void expect_order(std::vector<T> const& ascending) {
    for (std::size_t i = 0; i < ascending.size(); ++i) {
        K bits;
        std::memcpy(&bits, &ascending[i], sizeof bits);
        K const key = baseline::to_key<T>(bits);
        EXPECT_EQ(baseline::from_key<T>(key), bits);
        if (i == 0) continue;
        K before;
        std::memcpy(&before, &ascending[i - 1], sizeof before);
        EXPECT_LT(baseline::to_key<T>(before), key) << i;
    }
}

TEST(OrderKeys, AreOrderedAsValuesAndGoBack) {
    expect_order<std::int8_t, std::uint8_t>({-128, -1, 0, 1, 127});
    expect_order<std::uint8_t, std::uint8_t>({0, 1, 127, 128, 255});
    expect_order<std::uint16_t, std::int16_t>({0, 1, 32767, 32768, 65535});
    expect_order<std::int16_t, std::int16_t>({-32768, -1, 0, 32767});
    expect_order<std::uint32_t, std::int32_t>({0, 1, 0x7fffffff, 0x80000000, 0xffffffff});
    expect_order<std::int64_t, std::int64_t>({INT64_MIN, -1, 0, INT64_MAX});
    expect_order<std::uint64_t, std::int64_t>({0, 1, INT64_MAX, UINT64_MAX});
    constexpr float infinity = std::numeric_limits<float>::infinity();
    expect_order<float, std::int32_t>(
        {-infinity, -1e38f, -1, -1e-45f, -0.0f, 0.0f, 1e-45f, 1, infinity, std::numeric_limits<float>::quiet_NaN()});
    expect_order<double, std::int64_t>(
        {-1e308, -5e-324, 0.0, 5e-324, 1e308, HUGE_VAL, std::numeric_limits<double>::quiet_NaN()});
    expect_order<Half, std::int16_t>({Half(-HUGE_VALF), Half(-2.0f), Half(0.0f), Half(2.0f), Half(HUGE_VALF),
                                      Half(std::numeric_limits<float>::quiet_NaN())});
    auto const negative_nan = static_cast<std::int32_t>(0xffc00000);
    EXPECT_GT(baseline::to_key<float>(negative_nan), baseline::to_key<float>(std::int32_t{0x7f800000}));
}

} // namespace
} // namespace vkt
