// Estimates of interpolation against what waves really lose, half-way between voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/interpolation_choice.h"

#include "libvkt/core/error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace {

using namespace vkt;

Header header_of(Index3 dims) {
    Header header;
    header.dims = dims;
    header.dtype = DataType::float64;
    return header;
}

ConstView view_of(std::vector<double> const& voxels, Index3 dims) {
    return dense_view(reinterpret_cast<std::byte const*>(voxels.data()), DataType::float64, box_of(dims));
}

/// A wave along one axis, so many voxels long.
std::vector<double> wave(Index3 dims, int axis, double length, double offset = 0) {
    std::vector<double> voxels;
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x) {
                std::int64_t const p[3] = {x, y, z};
                voxels.push_back(offset + std::cos(2 * std::acos(-1.0) / length * static_cast<double>(p[axis])));
            }
    return voxels;
}

TEST(InterpolationChoice, EstimatesAreWhatWavesLose) {
    Index3 const dims{33, 34, 35};
    double const length = 16, turn = 2 * std::acos(-1.0) / length;
    for (int axis = 0; axis < 3; ++axis) {
        InterpolationChoice choice(header_of(dims), box_of(dims), {true, true, true});
        auto const voxels = wave(dims, axis, length);
        choice.scan(view_of(voxels, dims));
        // Of a cosine half-way: 1 - cos(h), with h half a voxel's turn, at the crest; the faces' clamped ends cost
        // more.
        double const linear = 1 - std::cos(turn / 2);
        EXPECT_GE(choice.error(ResampleMethod::linear), linear * 0.95) << axis;
        EXPECT_LE(choice.error(ResampleMethod::linear), linear * 4) << axis;
        EXPECT_LT(choice.error(ResampleMethod::cubic), choice.error(ResampleMethod::linear)) << axis;
        EXPECT_GT(choice.error(ResampleMethod::nearest), choice.error(ResampleMethod::linear)) << axis;
    }
}

TEST(InterpolationChoice, SlabsAndPiecesOfRowsMakeNoDifference) {
    Index3 const dims{19, 17, 15};
    std::vector<double> voxels;
    voxels.reserve(19 * 17 * 15);
    for (int i = 0; i < 19 * 17 * 15; ++i) voxels.push_back(std::sin(i * 1.7) * (i % 23));
    ConstView const all = view_of(voxels, dims);
    InterpolationChoice whole(header_of(dims), box_of(dims), {true, true, true}), pieces = whole;
    whole.scan(all);
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; y += 5)
            pieces.scan(all.part({{0, y, z}, {dims.x, std::min(y + 5, dims.y), z + 1}}));
    for (ResampleMethod const method : InterpolationChoice::candidates)
        EXPECT_EQ(whole.error(method), pieces.error(method));
}

TEST(InterpolationChoice, OnlyAxesThatAreInterpolatedCount) {
    Index3 const dims{16, 16, 16};
    auto const voxels = wave(dims, 2, 5);
    InterpolationChoice across(header_of(dims), box_of(dims), {true, true, false}),
        along(header_of(dims), box_of(dims), {false, false, true});
    across.scan(view_of(voxels, dims));
    along.scan(view_of(voxels, dims));
    EXPECT_EQ(across.error(ResampleMethod::nearest), 0);
    EXPECT_GT(along.error(ResampleMethod::lanczos3), 0.001);
}

TEST(InterpolationChoice, OffsetsCostNoDigitsAndWhatIsNotFiniteTakesNoPart) {
    Index3 const dims{24, 9, 8};
    auto const plain = wave(dims, 0, 8), far = wave(dims, 0, 8, 1e9);
    auto odd = plain;
    odd[100] = std::numeric_limits<double>::quiet_NaN();
    odd[300] = std::numeric_limits<double>::infinity();
    std::array<double, 3> errors{};
    std::size_t next = 0;
    for (auto const* const voxels : std::array<std::vector<double> const*, 3>{&plain, &far, &odd}) {
        InterpolationChoice choice(header_of(dims), box_of(dims), {true, false, false});
        choice.scan(view_of(*voxels, dims));
        errors.at(next++) = choice.error(ResampleMethod::linear);
    }
    EXPECT_NEAR(errors[0], errors[1], 1e-6);
    EXPECT_NEAR(errors[0], errors[2], 1e-6);
}

TEST(InterpolationChoice, TheCheapestWithinTheToleranceIsChosen) {
    Index3 const dims{40, 6, 6};
    auto const voxels = wave(dims, 0, 9, 5);
    auto const asked = [&](ValueTolerance const& tolerance) {
        InterpolationChoice choice(header_of(dims), box_of(dims), {true, false, false}, tolerance);
        choice.scan(view_of(voxels, dims));
        return choice;
    };
    InterpolationChoice const any = asked({});
    double const linear = any.error(ResampleMethod::linear), cubic = any.error(ResampleMethod::cubic);
    EXPECT_EQ(asked({10}).choose(false), ResampleMethod::nearest);
    EXPECT_EQ(asked({10}).choose(true), ResampleMethod::automatic); // nearest would leave voxels out
    EXPECT_EQ(asked({linear}).choose(false), ResampleMethod::automatic);
    EXPECT_EQ(asked({cubic}).choose(false), ResampleMethod::cubic);
    bool const smooth = cubic < any.error(ResampleMethod::lanczos3);
    InterpolationChoice least = asked({1e-12}), first = asked({10});
    EXPECT_EQ(least.choose(false), smooth ? ResampleMethod::cubic : ResampleMethod::lanczos3);
    EXPECT_TRUE(least.remark()->lossy);
    first.choose(false);
    EXPECT_FALSE(first.remark()->lossy);
    // Shares of the range, which is not the largest magnitude.
    auto const [low, high] = std::ranges::minmax(voxels);
    EXPECT_EQ(asked({100 * linear / (high - low) * 1.0001, true}).choose(false), ResampleMethod::automatic);
    EXPECT_EQ(asked({100 * linear / (high - low) * 0.9999, true}).choose(false), ResampleMethod::cubic);
}

} // namespace
