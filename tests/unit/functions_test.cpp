// One-line functions: what they make is what analytic answers and the operations themselves say.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/functions.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>

using namespace vkt;

namespace {

/// v(x, y, z) in float32.
template <class F> Volume made(Index3 dims, F const& f) {
    Header header;
    header.dims = dims;
    header.dtype = DataType::float32;
    Volume volume(header);
    View<float> const out = volume.mutable_view().as<float>();
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x) out(x, y, z) = static_cast<float>(f(x, y, z));
    return volume;
}

Volume ramp(Index3 dims) {
    return made(dims, [](auto x, auto y, auto z) { return x + 10 * y + 100 * z; });
}

float at(Volume const& volume, Index3 p) {
    float value = 0;
    std::memcpy(&value, volume.view().at(p.x, p.y, p.z), sizeof value);
    return value;
}

bool same(Volume const& a, Volume const& b) {
    ConstView const v = a.view(), w = b.view();
    return a.header().dims == b.header().dims && a.header().dtype == b.header().dtype &&
           std::memcmp(v.data, w.data, v.bytes()) == 0;
}

} // namespace

TEST(Functions, GaussianOfAnImpulseIsTheDensity) {
    Volume const impulse = made({33, 33, 33}, [](auto x, auto y, auto z) { return x == 16 && y == 16 && z == 16; });
    Volume const smooth = gaussian(impulse, {.sigma = 2, .tolerance = 0.0001});
    double const top = std::pow(2 * M_PI * 4, -1.5);
    EXPECT_NEAR(at(smooth, {16, 16, 16}), top, 2e-6);
    EXPECT_NEAR(at(smooth, {18, 16, 15}), top * std::exp(-5.0 / 8), 2e-6);
    Volume const along = gaussian(impulse, {.sigma = {0, 0, 2}});
    EXPECT_EQ(at(along, {17, 16, 16}), 0);
    EXPECT_GT(at(along, {16, 16, 17}), 0);
    EXPECT_EQ(smooth.header().history->command[1], "gaussian");
}

TEST(Functions, RegionsAreWordsOrBoxes) {
    Volume const volume = ramp({6, 5, 4});
    Volume const part = crop(volume, "1:4,:,2:");
    EXPECT_TRUE(same(part, crop(volume, Box{{1, 0, 2}, {4, 5, 4}})));
    EXPECT_EQ(at(part, {0, 0, 0}), 201);
    Volume const filled = fill(volume, {.value = -1, .roi = Box{{0, 0, 0}, {1, 1, 1}}});
    EXPECT_EQ(at(filled, {0, 0, 0}), -1);
    EXPECT_EQ(at(filled, {1, 0, 0}), 1);
    Volume const padded = pad(volume, {.below = {1, 0, 0}, .above = {0, 0, 2}, .boundary = {Boundary::border, 7}});
    EXPECT_EQ(padded.header().dims, (Index3{7, 5, 6}));
    EXPECT_EQ(at(padded, {0, 0, 0}), 7);
    EXPECT_EQ(at(padded, {1, 0, 0}), 0);
    EXPECT_THROW(crop(volume, "9:12,:,:"), Error);
}

TEST(Functions, TurnsAndMirrorsMoveVoxels) {
    Volume const volume = ramp({5, 5, 3});
    Volume turned = volume;
    for (int i = 0; i < 4; ++i) turned = rotate(turned, {.angle = 90});
    EXPECT_TRUE(same(volume, turned));
    Volume const once = rotate(volume, {.angle = 90}); // x goes to y
    EXPECT_EQ(at(once, {2, 4, 1}), at(volume, {4, 2, 1}));
    EXPECT_EQ(at(flip(volume, Axis::z), {0, 0, 0}), 200);
}

TEST(Functions, ResampleKeepsLinearContent) {
    Volume const volume = ramp({8, 8, 8});
    Volume const fine = resample(volume, {.scale = 2, .method = "linear"});
    EXPECT_EQ(fine.header().dims, (Index3{16, 16, 16}));
    EXPECT_FLOAT_EQ(at(fine, {5, 4, 7}), static_cast<float>(2.25 + 10 * 1.75 + 100 * 3.25));
    EXPECT_EQ(resample(volume, {.dims = Index3{4, 8, 2}}).header().dims, (Index3{4, 8, 2}));
    EXPECT_EQ(resample(volume, {.dims = Index3{4, 8, 2}, .dtype = DataType::float64}).header().dtype,
              DataType::float64);
    EXPECT_THROW(resample(volume, {}), Error);
}

TEST(Functions, MedianRemovesASpike) {
    Volume const spike = made({7, 7, 7}, [](auto x, auto, auto) { return x == 3 ? 9 : 1; });
    EXPECT_EQ(at(median(spike, {.radius = {2, 0, 0}}), {3, 3, 3}), 1);
    EXPECT_EQ(at(median(spike, {.radius = {0, 2, 2}}), {3, 3, 3}), 9);
    EXPECT_THROW(bilateral(spike, {}), Error); // without a deviation of values
    EXPECT_NEAR(at(bilateral(spike, {.range_sigma = 0.01}), {3, 3, 3}), 9, 1e-6);
}

TEST(Functions, MasksLabelsAndDistances) {
    Volume const volume = made({9, 5, 5}, [](auto x, auto, auto) { return x < 3 ? 5 : x < 6 ? 0 : 8; });
    Volume const mask = threshold(volume, {.above = 1});
    EXPECT_EQ(mask.header().dtype, DataType::uint8);
    EXPECT_EQ(stats(mask).sum, 6 * 25);
    EXPECT_EQ(stats(threshold(volume, {.above = 1, .below = 6})).sum, 3 * 25);
    EXPECT_GT(stats(threshold(volume)).sum, 0); // Otsu's
    Volume const components = label(mask, {.connectivity = 26, .dtype = DataType::uint16});
    EXPECT_EQ(components.header().dtype, DataType::uint16);
    EXPECT_EQ(stats(components).max, 2);
    EXPECT_EQ(stats(label(mask, {.keep_largest = 1})).max, 1);
    EXPECT_EQ(stats(distance(mask)).max, 3);
    EXPECT_EQ(stats(distance(mask, {.both_sides = true})).min, -2);
}

TEST(Functions, DerivativesOfARampAreItsSlopes) {
    Volume const volume = ramp({9, 9, 9});
    EXPECT_FLOAT_EQ(at(gradient(volume, {.component = "y"}), {4, 4, 4}), 10);
    EXPECT_FLOAT_EQ(at(sobel(volume, {.component = "z"}), {4, 4, 4}), 100);
    EXPECT_NEAR(at(gradient(volume), {4, 4, 4}), std::sqrt(10101.0), 1e-3);
    Volume const bowl = made({9, 9, 9}, [](auto x, auto y, auto z) { return x * x + 2 * y * y + 3 * z * z; });
    EXPECT_FLOAT_EQ(at(laplacian(bowl), {4, 4, 4}), 12);
    EXPECT_EQ(laplacian(bowl, {.dtype = DataType::float64}).header().dtype, DataType::float64);
    Volume const smooth = laplacian(bowl, {.sigma = 0.5});
    EXPECT_NEAR(at(smooth, {4, 4, 4}), 12, 0.05);
    // Of what is linear nothing is smoothed away.
    EXPECT_NEAR(at(sharpen(volume, {.sigma = 0.5, .amount = 3}), {4, 4, 4}), at(volume, {4, 4, 4}), 1e-2);
}

TEST(Functions, Windows) {
    Volume const volume = ramp({9, 9, 9});
    EXPECT_FLOAT_EQ(at(box_mean(volume, {.radius = 2}), {4, 4, 4}), 444);
    EXPECT_EQ(at(morphology("dilate", volume, {.radius = {1, 0, 0}, .shape = "box"}), {4, 4, 4}), 445);
    EXPECT_EQ(at(morphology("erode", volume, {.radius = 1}), {4, 4, 4}), 344);
    Volume const flat = made({20, 20, 20}, [](auto, auto, auto) { return 7; });
    EXPECT_EQ(at(nlmeans(flat, {.noise = 1}), {5, 6, 7}), 7);
    Volume const equal = clahe(volume, {.clip = 3, .bricks = {2, 2, 2}, .bins = 64});
    EXPECT_EQ(equal.header().dims, volume.header().dims);
}

TEST(Functions, MovesAndParts) {
    Volume const volume = ramp({6, 5, 4});
    EXPECT_EQ(at(permute(volume, "zyx"), {3, 2, 1}), 321);
    EXPECT_EQ(permute(volume, "zyx").header().dims, (Index3{4, 5, 6}));
    Volume const cut = slice(volume, Axis::y, -1);
    EXPECT_EQ(cut.header().dims.x * cut.header().dims.y * cut.header().dims.z, 24);
    EXPECT_EQ(at(project("max", volume, {.axis = Axis::x}), {0, 0, 0}), 5);
    EXPECT_EQ(at(paste(crop(volume, "0:1,0:1,3:4"), volume, {5, 4, 0}), {5, 4, 0}), 300);
    EXPECT_TRUE(same(affine(volume, {}), volume));
    Volume const moved = affine(volume, {.matrix = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0}, .voxels = true});
    EXPECT_EQ(at(moved, {2, 1, 1}), 113);
    EXPECT_FLOAT_EQ(at(scale(ramp({9, 9, 9}), {.factor = 2, .method = "linear"}), {6, 4, 4}), 445);
}

TEST(Functions, FloodsSumsAndExpressions) {
    Volume const volume = ramp({6, 5, 4});
    Volume const ones = made({3, 3, 3}, [](auto, auto, auto) { return 1; });
    EXPECT_EQ(stats(scan(ones)).max, 27);
    EXPECT_EQ(stats(scan(ones, true)).max, 8);
    EXPECT_EQ(at(transform("v * 2 + a", volume, {.others = {volume}}), {1, 2, 3}), 963);
    EXPECT_EQ(at(transform("v[1,0,0]", volume, {.boundary = {{Boundary::border, -4}}}), {5, 0, 0}), -4);
    EXPECT_EQ(transform("v > 3", volume, {.dtype = DataType::uint8}).header().dtype, DataType::uint8);
    Volume const shell =
        convert(made({7, 7, 7},
                     [](auto x, auto y, auto z) {
                         auto const far = std::max({std::abs(x - 3), std::abs(y - 3), std::abs(z - 3)});
                         return far == 2;
                     }),
                DataType::uint8);
    EXPECT_EQ(stats(fill_holes(shell)).sum, 125);
    Volume const valley = made({9, 3, 3}, [](auto x, auto, auto) { return x == 4 ? 9 : 0; });
    EXPECT_EQ(stats(watershed(valley)).max, 2);
    Volume const markers =
        convert(made({9, 3, 3}, [](auto x, auto y, auto z) { return x + y + z == 0 ? 5 : 0; }), DataType::uint8);
    EXPECT_EQ(stats(watershed(valley, {.markers = markers})).min, 5);
}

TEST(Functions, Arithmetic) {
    Volume const volume = ramp({4, 3, 2});
    EXPECT_EQ(stats(arith("sub", volume, volume)).max, 0);
    EXPECT_EQ(at(arith("mul", volume, -2), {1, 1, 1}), -222);
    EXPECT_EQ(convert(volume, DataType::uint8).header().dtype, DataType::uint8);
}

TEST(Functions, StatisticsOfARegion) {
    StatisticsResult const all = stats(ramp({6, 5, 4}));
    EXPECT_EQ(all.count, 120);
    EXPECT_EQ(all.max, 345);
    EXPECT_EQ(all.argmax, (Index3{5, 4, 3}));
    EXPECT_EQ(stats(ramp({6, 5, 4}), {.roi = "0:2,0:1,0:1"}).sum, 1);
}

TEST(Functions, CallsSayHowTheyRun) {
    Volume const volume = ramp({64, 64, 64});
    std::string said;
    CallOptions how;
    how.execution.threads = 1;
    how.listener = [&](std::string const&, std::string const& message, bool) { said += message; };
    (void)convert(volume, DataType::int8, how);
    EXPECT_NE(said.find("clipped"), std::string::npos);
    how.execution.memory = "1KiB";
    EXPECT_THROW((void)gaussian(volume, {}, how), Error);
}

TEST(ProgressMonitor, TellsTheOwnerAndEndsTheWork) {
    std::vector<double> told;
    ProgressMonitor monitor([&](double done) {
        told.push_back(done);
        return false;
    });
    Volume const volume = ramp({96, 96, 96});
    Volume const watched = gaussian(volume, {.sigma = 3}, {.monitor = &monitor});
    EXPECT_TRUE(same(watched, gaussian(volume, {.sigma = 3})));
    ASSERT_FALSE(told.empty());
    EXPECT_EQ(told.front(), 0);
    EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
    EXPECT_LE(told.back(), 1);

    ProgressMonitor stop([](double) { return true; });
    for (char const* const words :
         {"filter gaussian", "filter median", "flip x", "rotate --angle 10", "distance", "label", "watershed",
          "threshold --otsu", "clahe", "filter nlmeans --noise 1", "scan"}) {
        std::vector<std::string> list;
        std::string const text = words;
        for (std::size_t i = 0, j = 0; i != std::string::npos; i = j == std::string::npos ? j : j + 1)
            list.push_back(text.substr(i, (j = text.find(' ', i)) - i));
        try {
            (void)apply(list, {volume}, {.monitor = &stop});
            ADD_FAILURE() << words << " was not cancelled";
        } catch (Error const& e) {
            EXPECT_EQ(e.kind(), ErrorKind::cancelled) << words << ": " << e.what();
        }
    }
    EXPECT_THROW((void)stats(volume, {}, {.monitor = &stop}), Error);
}
