// Sums of groups as GPUs compute them, of integers, against long double: the same bits.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/host_sums.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

namespace vkt {
namespace {

static_assert(std::numeric_limits<long double>::digits == 64);

long double host(Extended const& number) {
    long double const size = std::ldexp(static_cast<long double>(number.mantissa), number.exponent);
    return number.negative != 0 ? -size : size;
}
bool same(long double a, long double b) { return a == b && std::signbit(a) == std::signbit(b); }

/// Any finite double; ones with few bits, whose sums and products often lie halfway, and ones near each other.
double some_double(std::mt19937_64& random) {
    std::uint64_t const bits = random();
    auto const small = static_cast<double>(static_cast<std::int64_t>(random() % 2001) - 1000);
    switch (random() % 6) {
    case 0: {
        auto const any = std::bit_cast<double>(bits);
        return std::isfinite(any) ? any : 0.0;
    }
    case 1:
        return std::ldexp(small, static_cast<int>(bits % 140) - 70);
    case 2:
        return std::bit_cast<double>(bits % (std::uint64_t{1} << 54)); // subnormal, or nearly
    case 3:
        return std::ldexp(1.0, static_cast<int>(bits % 130)) * (random() % 2 == 0 ? 1 : -1);
    case 4:
        return small == 0 ? -0.0 : small;
    default:
        return std::ldexp(static_cast<double>(bits >> 11), -53) + small;
    }
}

TEST(Extended, IsLongDouble) {
    std::mt19937_64 random(17);
    for (int round = 0; round < 400000; ++round) {
        double const a = some_double(random), b = some_double(random), c = some_double(random);
        Extended const x(a), y(b), z(c);
        auto const la = static_cast<long double>(a), lb = static_cast<long double>(b), lc = static_cast<long double>(c);
        ASSERT_TRUE(same(host(x), la)) << a;
        ASSERT_TRUE(same(host(x + y), la + lb)) << a << " + " << b;
        ASSERT_TRUE(same(host(x - y), la - lb)) << a << " - " << b;
        ASSERT_TRUE(same(host(x * y), la * lb)) << a << " * " << b;
        // Of 64 bits each.
        ASSERT_TRUE(same(host((x + y) + z), (la + lb) + lc)) << a << " " << b << " " << c;
        ASSERT_TRUE(same(host((x + y) - (y + z)), (la + lb) - (lb + lc))) << a << " " << b << " " << c;
        if (std::abs(a) < 1e300 && std::abs(b) < 1e300 && std::abs(c) < 1e300) {
            ASSERT_TRUE(same(host((x + y) * (y - z)), (la + lb) * (lb - lc))) << a << " " << b << " " << c;
            ASSERT_TRUE(same(host(x * y + y * z), la * lb + lb * lc)) << a << " " << b << " " << c;
            ASSERT_TRUE(same(host(x * y - y * x), la * lb - lb * la)) << a << " " << b;
        }
    }
}

TEST(Extended, IsLongDoubleOfBitsFarApart) {
    for (int by = 0; by < 200; ++by)
        for (std::uint64_t low : {1ULL, 2ULL, 3ULL, 1ULL << 63, (1ULL << 63) + 1, ~0ULL, ~0ULL - 1, 5ULL << 60})
            for (std::uint64_t high : {1ULL << 63, (1ULL << 63) + 1, ~0ULL, ~0ULL - 1, 3ULL << 62})
                for (bool const negative : {false, true}) {
                    Extended const a = Extended::of_integer(high, false);
                    Extended b = Extended::of_integer(low, negative);
                    b.exponent -= by;
                    long double const la = host(a), lb = host(b);
                    ASSERT_TRUE(same(host(a + b), la + lb)) << high << " " << low << " " << by;
                    ASSERT_TRUE(same(host(b - a), lb - la)) << high << " " << low << " " << by;
                    ASSERT_TRUE(same(host(a * b), la * lb)) << high << " " << low << " " << by;
                }
}

template <class T> T some(std::mt19937_64& random, int kind) {
    std::uint64_t const bits = random();
    if constexpr (std::is_integral_v<T>) {
        if (kind == 0) return static_cast<T>(bits);
        if (kind == 1) return static_cast<T>(1 + bits % 3);
        return bits % 2 == 0 ? std::numeric_limits<T>::max() : std::numeric_limits<T>::min();
    } else {
        double value = some_double(random);
        if (kind == 1) value = 1e5 + std::ldexp(static_cast<double>(bits >> 40), -24);
        if (kind == 2 && bits % 9 < 4) {
            constexpr double infinity = std::numeric_limits<double>::infinity();
            value = bits % 9 == 0 ? infinity : bits % 9 == 1 ? -infinity : bits % 9 == 2 ? std::nan("") : -0.0;
        }
        return T(value);
    }
}

bool same(Product const& a, Product const& b) { return same(a.mantissa, b.mantissa) && a.exponent == b.exponent; }
bool same(Extreme const& a, Extreme const& b) {
    return a.valid == b.valid && a.where == b.where && a.integer == b.integer &&
           std::memcmp(&a.value, &b.value, sizeof a.value) == 0;
}

template <class T> void compare_sums(DataType type) {
    std::mt19937_64 random(static_cast<unsigned>(type) + 3);
    ValueMap const maps[] = {{}, {0.5, -3}, {-1e-7, 0}, {1e200, 1e190}};
    for (int round = 0; round < 300; ++round) {
        ValueMap const map = maps[random() % 4];
        bool const mapped = !(map == ValueMap{});
        int const kind = static_cast<int>(random() % 3);
        RunningSums<T, HostNumbers> on_cpu;
        RunningSums<T, DeviceNumbers> on_gpu;
        for (std::int64_t i = 0, n = static_cast<std::int64_t>(random() % 900); i < n; ++i) {
            T const stored = some<T>(random, kind);
            on_cpu.add(stored, i, map, mapped);
            on_gpu.add(stored, i, map, mapped);
        }
        Index3 const lower{3, 4, 5};
        PartialStatistics const a = partial_of(on_cpu.sums(), type, lower, 7),
                                b = partial_of(on_host(on_gpu.sums()), type, lower, 7);
        ASSERT_EQ(a.moments.finite, b.moments.finite);
        ASSERT_EQ(a.moments.nan, b.moments.nan);
        ASSERT_EQ(a.moments.positive_infinity, b.moments.positive_infinity);
        ASSERT_EQ(a.moments.negative_infinity, b.moments.negative_infinity);
        ASSERT_TRUE(a.moments.integer_sum == b.moments.integer_sum && a.moments.squares == b.moments.squares);
        ASSERT_TRUE(same(a.moments.sum, b.moments.sum)) << a.moments.sum << " " << b.moments.sum;
        ASSERT_TRUE(same(a.moments.mean, b.moments.mean)) << a.moments.mean << " " << b.moments.mean;
        ASSERT_TRUE(same(a.moments.deviations, b.moments.deviations));
        ASSERT_EQ(a.origin.known, b.origin.known);
        ASSERT_TRUE(a.origin.value == b.origin.value && a.origin.integer == b.origin.integer);
        ASSERT_TRUE(same(a.min, b.min) && same(a.max, b.max));
        ASSERT_TRUE(same(a.product, b.product)) << static_cast<double>(a.product.mantissa) << " " << a.product.exponent;
    }
}

TEST(RunningSums, AreTheSameBitsOnGpus) {
    for (int t = 0; t < data_type_count; ++t)
        with_type(static_cast<DataType>(t), [&]<class T>(T) { compare_sums<T>(static_cast<DataType>(t)); });
}

TEST(RowBlocks, CoverASlabOnce) {
    for (Index3 const dims : {Index3{5, 7, 3}, Index3{1, 1, 1}, Index3{4, 8, 2}})
        for (std::int64_t rows : {1, 2, 3, 8, 100}) {
            RowBlocks const blocks(dims, rows);
            std::int64_t y = 0, z = 0;
            for (std::int64_t b = 0; b < blocks.count; ++b) {
                ASSERT_EQ(blocks.z(b), z);
                ASSERT_EQ(blocks.first_row(b), y);
                ASSERT_GE(blocks.rows_of(b), 1);
                y += blocks.rows_of(b);
                if (y == dims.y) y = 0, ++z;
            }
            ASSERT_EQ(z, dims.z);
        }
}

} // namespace
} // namespace vkt
