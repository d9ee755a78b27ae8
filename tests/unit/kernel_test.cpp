// Rounding, half precision and the drivers, against definitions and against the compiler's own binary16.
// SPDX-License-Identifier: MIT
#define VKT_BACKEND baseline
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
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
struct Padded {
    explicit Padded(Box b)
        : box(b), values(static_cast<std::size_t>((b.dims().x + 3) * (b.dims().y + 1) * b.dims().z + 8), -7) {}
    View<int> view() {
        return {values.data() + 1, box.lower, box.dims().x + 3, (box.dims().x + 3) * (box.dims().y + 1)};
    }
    Box box;
    std::vector<int> values;
};

TEST(Drivers, MapsWithAndWithoutPositionAndLeavesTheGapsAlone) {
    Execution execution;
    execution.threads = 2;
    Box const box{{5, -2, 1}, {5 + 9000, 3, 4}}; // rows longer than a segment
    Padded in(box), out(box);
    for (std::size_t i = 0; i < in.values.size(); ++i) in.values[i] = static_cast<int>(i % 1000);
    View<int const> const from{in.view().data, in.view().lower, in.view().row, in.view().slice};
    baseline::map(
        execution, box, out.view(), [](int v) { return 2 * v; }, from);
    for (std::int64_t z = 1; z < 4; ++z)
        for (std::int64_t y = -2; y < 3; ++y) {
            for (std::int64_t x = 5; x < 9005; ++x) ASSERT_EQ(out.view()(x, y, z), 2 * from(x, y, z));
            ASSERT_EQ(out.view()(9005, y, z), -7);
        }
    baseline::map_at(
        execution, box, out.view(),
        [](std::int64_t x, std::int64_t y, std::int64_t z, int v) { return static_cast<int>(x + 100 * y + 7 * z) + v; },
        from);
    EXPECT_EQ(out.view()(8200, 2, 3), 8200 + 200 + 21 + from(8200, 2, 3));
    baseline::gather(execution, box, out.view(),
                     [=](std::int64_t x, std::int64_t y, std::int64_t z) { return from(x == 5 ? 5 : x - 1, y, z); });
    EXPECT_EQ(out.view()(5, 0, 2), from(5, 0, 2));
    EXPECT_EQ(out.view()(8197, 0, 2), from(8196, 0, 2));
}

TEST(Drivers, RoundedMapsCountWhatIsLost) {
    Execution execution;
    execution.threads = 2;
    Box const box = box_of({500, 30, 10});
    std::vector<float> in(150000);
    for (std::size_t i = 0; i < in.size(); ++i) in[i] = static_cast<float>(i % 300);
    for (std::size_t i = 0; i < 77; ++i) in[i * 1000] = std::numeric_limits<float>::quiet_NaN();
    std::int64_t expected = 0;
    for (float v : in) expected += v > 255 ? 1 : 0;
    std::vector<std::uint8_t> out(in.size());
    Losses losses;
    baseline::map_rounded(
        execution, box, View<std::uint8_t>{out.data(), {}, 500, 15000}, losses, [](float v) { return v; },
        View<float const>{in.data(), {}, 500, 15000});
    EXPECT_EQ(losses.nan, 77);
    EXPECT_EQ(losses.clipped, expected);
    EXPECT_EQ(out[290], 255);
    EXPECT_EQ(out[1000], 0);
    EXPECT_EQ(out[1001], in[1001]);
}

} // namespace
} // namespace vkt
