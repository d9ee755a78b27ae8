// Rounding, half precision and the drivers, against definitions and against the compiler's own binary16.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/stencil.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <random>
#include <vector>

namespace vkt {
namespace {

// clang before 15 has no half precision on x86 to compare with.
#if !defined(__clang__) || __clang_major__ >= 15
#define VKT_NATIVE_HALF
__extension__ using Native = _Float16;
#endif

using baseline::is_clipped;
using baseline::round_to;

#ifdef VKT_NATIVE_HALF
std::uint16_t native_bits(Native value) {
    std::uint16_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    return bits;
}

TEST(Half, WidensAllValuesExactly) {
    for (std::uint32_t i = 0; i < 65536; ++i) {
        auto const bits = static_cast<std::uint16_t>(i);
        Native native{};
        std::memcpy(&native, &bits, sizeof native);
        auto const expected = static_cast<float>(native);
        auto const got = static_cast<float>(Half::from_bits(bits));
        if (std::isnan(expected)) {
            ASSERT_TRUE(std::isnan(got)) << i;
        } else {
            ASSERT_EQ(detail::bits_as<std::uint32_t>(expected), detail::bits_as<std::uint32_t>(got)) << i;
        }
        ASSERT_EQ(std::isnan(got) ? bits & 0x7c00u : bits, std::isnan(got) ? 0x7c00u : Half(got).bits) << i;
    }
}

TEST(Half, NarrowsLikeTheCompiler) {
    auto check = [](float f) {
        auto const expected = native_bits(static_cast<Native>(f));
        if (std::isnan(f)) {
            ASSERT_TRUE(std::isnan(static_cast<float>(Half(f))));
        } else {
            ASSERT_EQ(expected, Half(f).bits) << f;
        }
    };
    // Around every half: the value, the midpoint to the next, and the floats next to both.
    for (std::uint32_t i = 0; i < 0x7c00; ++i) {
        auto const a = static_cast<float>(Half::from_bits(static_cast<std::uint16_t>(i)));
        auto const b =
            i + 1 == 0x7c00 ? 65536.0f : static_cast<float>(Half::from_bits(static_cast<std::uint16_t>(i + 1)));
        float const middle = a + (b - a) * 0.5f;
        for (float f :
             {a, middle, std::nextafter(middle, 0.0f), std::nextafter(middle, 1e9f), std::nextafter(a, 1e9f)}) {
            check(f);
            check(-f);
        }
    }
    for (float f : {65519.996f, 65520.0f, 1e20f, std::numeric_limits<float>::infinity(), 0x1p-25f, 0x1.000002p-25f,
                    1e-45f, std::numeric_limits<float>::quiet_NaN()})
        check(f);
}
#endif

TEST(Half, NarrowsDoublesWithOneRounding) {
    std::mt19937_64 random(3);
    for (int i = 0; i < 200000; ++i) {
        // Midpoints plus a little: rounding to float first would lose the little.
        auto const bits = static_cast<std::uint16_t>(random() % 0x7bff);
        auto const a = static_cast<double>(static_cast<float>(Half::from_bits(bits)));
        auto const b = static_cast<double>(static_cast<float>(Half::from_bits(static_cast<std::uint16_t>(bits + 1))));
        double const middle = (a + b) / 2;
        EXPECT_EQ(Half(std::nextafter(middle, 1e9)).bits, bits + 1);
        EXPECT_EQ(Half(std::nextafter(middle, -1.0)).bits, bits);
        EXPECT_EQ(Half(middle).bits, bits + (bits & 1));
    }
    EXPECT_EQ(Half(1e300).bits, 0x7c00);
    EXPECT_EQ(Half(-1e300).bits, 0xfc00);
    EXPECT_EQ(Half(1e-300).bits, 0);
}

TEST(RoundTo, HalvesToEvenSaturatesAndHasNoNan) {
    float const nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    float const in[] = {-0.5f, 0.5f, 1.5f, 2.5f, 254.5f, 255.49f, 255.5f, 1e20f, -1e20f, nan, inf};
    int const out[] = {0, 0, 2, 2, 254, 255, 255, 255, 0, 0, 255};
    bool const clipped[] = {false, false, false, false, false, false, true, true, true, false, true};
    for (std::size_t i = 0; i < std::size(in); ++i) {
        EXPECT_EQ(round_to<std::uint8_t>(in[i]), out[i]) << in[i];
        EXPECT_EQ(is_clipped<std::uint8_t>(in[i]), clipped[i]) << in[i];
        EXPECT_EQ(round_to<std::uint8_t>(static_cast<double>(in[i])), out[i]) << in[i];
    }
    EXPECT_EQ(round_to<std::int8_t>(-128.5f), -128);
    EXPECT_FALSE(is_clipped<std::int8_t>(-128.5f));
    EXPECT_TRUE(is_clipped<std::int8_t>(-128.6f));
    EXPECT_EQ(round_to<std::int16_t>(nan), 0);
    EXPECT_EQ(round_to<std::int16_t>(-40000.0f), -32768);
    EXPECT_EQ(round_to<std::uint16_t>(65534.5f), 65534);
    EXPECT_EQ(round_to<std::uint32_t>(4294967295.4), 4294967295u);
    EXPECT_EQ(round_to<std::uint32_t>(4294967296.0), 4294967295u);
    EXPECT_TRUE(is_clipped<std::uint32_t>(4294967295.5));
    EXPECT_EQ(round_to<std::int32_t>(-2147483648.5), std::numeric_limits<std::int32_t>::min());
    EXPECT_EQ(round_to<std::int32_t>(-2.5), -2);
    EXPECT_EQ(round_to<std::int32_t>(3.5), 4);
    EXPECT_EQ(round_to<std::int64_t>(9.3e18), std::numeric_limits<std::int64_t>::max());
    EXPECT_EQ(round_to<std::int64_t>(-9.3e18), std::numeric_limits<std::int64_t>::min());
    EXPECT_EQ(round_to<std::int64_t>(2.5), 2);
    EXPECT_EQ(round_to<std::uint64_t>(2e19), std::numeric_limits<std::uint64_t>::max());
    EXPECT_EQ(round_to<std::uint64_t>(0x1.8p63), 0xc000000000000000u);
    EXPECT_EQ(round_to<std::uint64_t>(-3.0), 0u);
    EXPECT_EQ(round_to<std::int16_t>(static_cast<double>(nan)), 0);
    EXPECT_EQ(round_to<std::uint8_t>(-3), 0);
    EXPECT_EQ(round_to<std::int8_t>(std::uint64_t{1} << 60), 127);
}

template <class T> void expect_border(DataType type, double value, T stored) {
    std::vector<T> voxels(12, T(1));
    AnyView const window = dense_view(reinterpret_cast<std::byte*>(voxels.data()), type, {{-2, 0, 0}, {10, 1, 1}});
    fill_border(window, {{0, 0, 0}, {8, 1, 1}}, {8, 1, 1}, Boundary::border, value, Execution{});
    for (std::size_t i = 0; i < voxels.size(); ++i)
        EXPECT_EQ(voxels[i], i < 2 || i >= 10 ? stored : T(1)) << name_of(type) << " " << value << " " << i;
}

TEST(FillBorder, ValuesRoundAndSaturateAsElsewhere) {
    expect_border<std::uint8_t>(DataType::uint8, 2.5, 2);
    expect_border<std::uint8_t>(DataType::uint8, 300, 255);
    expect_border<std::int16_t>(DataType::int16, std::nan(""), 0);
    expect_border<std::int64_t>(DataType::int64, 1e30, std::numeric_limits<std::int64_t>::max());
    expect_border<std::uint64_t>(DataType::uint64, -1, 0);
    expect_border<float>(DataType::float32, -2.5, -2.5f);
    // A double just above the tie between two halves: rounding to float first would lose it.
    expect_border<std::uint16_t>(DataType::float16, 1 + 0x1p-11 + 0x1p-40, 0x3c01);
}

TEST(RoundTo, AgreesWithNearbyintOnAllQuarters) {
    for (int i = -140000 * 4; i <= 140000 * 4; ++i) {
        float const v = static_cast<float>(i) / 4;
        double const r = std::nearbyint(static_cast<double>(v));
        ASSERT_EQ(round_to<std::uint16_t>(v), static_cast<std::uint16_t>(std::clamp(r, 0.0, 65535.0)));
        ASSERT_EQ(round_to<std::int16_t>(v), static_cast<std::int16_t>(std::clamp(r, -32768.0, 32767.0)));
        ASSERT_EQ(round_to<std::int32_t>(static_cast<double>(v)), static_cast<std::int32_t>(r));
        ASSERT_EQ(is_clipped<std::uint16_t>(v), r < 0.0 || r > 65535.0);
    }
}

/// A window with gaps between rows and slices, on odd offsets.
template <class T> struct Padded {
    explicit Padded(DataType t, Box b)
        : box(b), type(t),
          values(static_cast<std::size_t>((b.dims().x + 3) * (b.dims().y + 1) * b.dims().z + 8), T(7)) {}
    AnyView view() {
        std::int64_t const row = box.dims().x + 3;
        return {reinterpret_cast<std::byte*>(values.data() + 1), type, box, row, row * (box.dims().y + 1), Space::host};
    }
    T& operator()(std::int64_t x, std::int64_t y, std::int64_t z) { return view().template as<T>()(x, y, z); }
    Box box;
    DataType type;
    std::vector<T> values;
};

struct Twice {
    float operator()(float v) const { return 2 * v; }
};
struct Sum {
    double operator()(double u, double v) const { return u + v; }
    bool undefined(double u, double) const { return u == 3; }
};
struct Position {
    double operator()(double x, double y, double z, double v) const { return x + 100 * y + 7 * z + v; }
};
struct Ramp {
    float operator()(double x, double, double) const { return static_cast<float>(x); }
};

Execution on_threads(int threads) {
    Execution execution;
    execution.threads = threads;
    return execution;
}

TEST(Drivers, MapsAnyTypesAndLeavesTheGapsAlone) {
    Box const box{{5, -2, 1}, {5 + 9000, 3, 4}}; // rows longer than a segment
    Padded<std::uint16_t> in(DataType::uint16, box);
    Padded<std::int32_t> out(DataType::int32, box);
    for (std::size_t i = 0; i < in.values.size(); ++i) in.values[i] = static_cast<std::uint16_t>(i % 1000);
    Losses losses;
    baseline::map<float>(on_threads(2), out.view(), losses, Twice{}, ConstView(in.view()));
    for (std::int64_t z = 1; z < 4; ++z)
        for (std::int64_t y = -2; y < 3; ++y) {
            for (std::int64_t x = 5; x < 9005; ++x) ASSERT_EQ(out(x, y, z), 2 * in(x, y, z));
            ASSERT_EQ(*(&out(9004, y, z) + 1), 7);
        }
    EXPECT_FALSE(losses.any());
    Padded<double> sum(DataType::float64, box);
    baseline::map<double>(on_threads(3), sum.view(), losses, Sum{}, ConstView(in.view()), ConstView(out.view()));
    EXPECT_EQ(sum(8000, 1, 2), 3 * in(8000, 1, 2));
    EXPECT_EQ(losses.undefined, std::count_if(&sum(5, -2, 1), &*sum.values.end(), [](double v) { return v == 9; }));
    baseline::map_at<double>(on_threads(2), out.view(), losses, Position{}, ConstView(in.view()));
    EXPECT_EQ(out(8200, 2, 3), 8200 + 200 + 21 + in(8200, 2, 3));
    Padded<std::int8_t> bytes(DataType::int8, box);
    losses = {};
    baseline::map_at<float>(on_threads(1), bytes.view(), losses, Ramp{});
    EXPECT_EQ(losses.clipped, (9004 - 127) * 15);
    EXPECT_EQ(bytes(127, 0, 2), 127);
    EXPECT_EQ(bytes(4000, 0, 2), 127);
}

struct Same {
    template <class C> C operator()(C v) const { return v; }
};

TEST(Drivers, LossesAreCountedInOutputsOfAnySize) {
    for (std::int64_t const n : {1, 15, 16, 17, 31, 500, 30000000}) { // the last is written past the caches
        std::vector<float> in(static_cast<std::size_t>(n));
        for (std::size_t i = 0; i < in.size(); ++i)
            in[i] = i % 13 == 5 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(i % 300) - 0.5F;
        std::int64_t clipped = 0, nan = 0;
        for (float const v : in) {
            clipped += v >= 255.5F || v < -0.5F;
            nan += v != v;
        }
        std::vector<std::uint8_t> out(in.size());
        Losses losses;
        Box const box = box_of({n, 1, 1});
        AnyView const to = dense_view(reinterpret_cast<std::byte*>(out.data()), DataType::uint8, box);
        baseline::map<float>(on_threads(2), to, losses, Same{},
                             dense_view(reinterpret_cast<std::byte const*>(in.data()), DataType::float32, box));
        EXPECT_EQ(losses.nan, nan) << n;
        EXPECT_EQ(losses.clipped, clipped) << n;
        for (std::size_t i = 0; i < out.size(); ++i) ASSERT_EQ(out[i], round_to<std::uint8_t>(in[i])) << i;
    }
}

TEST(Drivers, WholeNumbersOf64BitsStayWhole) {
    std::vector<std::int64_t> in{std::numeric_limits<std::int64_t>::min(), -1, 0, (std::int64_t{1} << 53) + 1,
                                 std::numeric_limits<std::int64_t>::max()};
    std::vector<std::uint64_t> out(in.size());
    Losses losses;
    Box const box = box_of({static_cast<std::int64_t>(in.size()), 1, 1});
    baseline::map<Int128>(on_threads(1), dense_view(reinterpret_cast<std::byte*>(out.data()), DataType::uint64, box),
                          losses, Same{},
                          dense_view(reinterpret_cast<std::byte const*>(in.data()), DataType::int64, box));
    EXPECT_EQ(out, (std::vector<std::uint64_t>{0, 0, 0, (std::uint64_t{1} << 53) + 1, ~std::uint64_t{0} >> 1}));
    EXPECT_EQ(losses.clipped, 2);
}

struct Total {
    double sum = 0;
    std::int64_t count = 0;
    void add_row(double const* values, std::int64_t n) {
        for (std::int64_t i = 0; i < n; ++i) sum += values[i];
        count += n;
    }
    void merge(Total const& other) {
        sum += other.sum;
        count += other.count;
    }
};

TEST(Drivers, ReduceSeesEveryVoxelOnce) {
    Box const box{{-3, 2, 0}, {-3 + 4099, 9, 5}};
    Padded<std::int16_t> in(DataType::int16, box);
    double expected = 0;
    for (std::int64_t z = 0; z < 5; ++z)
        for (std::int64_t y = 2; y < 9; ++y)
            for (std::int64_t x = -3; x < 4096; ++x) {
                in(x, y, z) = static_cast<std::int16_t>(x * 7 + y - z);
                expected += in(x, y, z);
            }
    for (int const threads : {1, 2, 5}) {
        Total const total = baseline::reduce<double>(on_threads(threads), in.view(), Total{});
        EXPECT_EQ(total.count, box.voxels());
        EXPECT_EQ(total.sum, expected);
    }
}

/// A neighbour and the centre, so that a wrong offset shows.
template <class C> struct Neighbours {
    int dx, dy, dz;
    template <class W> auto operator()(W const& w) const { return w(dx, dy, dz) + w(0, 0, 0); }
};

TEST(Drivers, StencilsSeeTheirNeighbours) {
    for (Index3 const n : {Index3{1, 1, 1}, {17, 3, 2}, {1030, 11, 9}, {64, 20, 5}})
        for (Index3 const radius : {Index3{0, 0, 0}, {1, 1, 1}, {3, 0, 2}}) {
            Box const box{{10, 20, 30}, Index3{10, 20, 30} + n}, around{box.lower - radius, box.upper + radius};
            Padded<std::uint16_t> in(DataType::uint16, around);
            for (std::size_t i = 0; i < in.values.size(); ++i) in.values[i] = static_cast<std::uint16_t>(i * 31 % 997);
            Padded<float> out(DataType::float32, box);
            Padded<std::uint16_t> whole(DataType::uint16, box);
            for (int const sign : {-1, 1}) {
                Index3 const d{sign * radius.x, -sign * radius.y, sign * radius.z};
                Losses losses;
                Neighbours<float> const f{static_cast<int>(d.x), static_cast<int>(d.y), static_cast<int>(d.z)};
                baseline::stencil<float>(on_threads(3), out.view(), losses, radius, f, ConstView(in.view()));
                baseline::stencil<std::uint16_t>(on_threads(2), whole.view(), losses, radius, f, ConstView(in.view()));
                for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
                    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                        for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
                            int const expected = in(x + d.x, y + d.y, z + d.z) + in(x, y, z);
                            ASSERT_EQ(out(x, y, z), static_cast<float>(expected)) << text(n, " ", radius, " ", x);
                            ASSERT_EQ(whole(x, y, z), expected) << text(n, " ", radius, " ", x);
                        }
            }
        }
}

// Memory may be missed in any part of a loop, and no exception may leave a parallel region.
TEST(ForEachItem, ThrowsWhatAPartThrowsAfterTheOthersAreDone) {
    for (int const threads : {1, 4}) {
        std::atomic<std::int64_t> done = 0;
        EXPECT_THROW(baseline::for_each_item(threads, 1000,
                                             [&](std::int64_t begin, std::int64_t end) {
                                                 if (begin == 0) throw std::bad_alloc();
                                                 done += end - begin;
                                             }),
                     std::bad_alloc);
        EXPECT_LE(done, threads > 1 ? 750 : 0);
        baseline::for_each_item(threads, 1000, [&](std::int64_t begin, std::int64_t end) { done += end - begin; });
        EXPECT_GE(done, 1000);
    }
}

} // namespace
} // namespace vkt
