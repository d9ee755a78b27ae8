// Paths, the exact reference, projections and goals on hierarchical volumes: against structured ones that hold the
// same, closed forms, and against themselves.
// SPDX-License-Identifier: MIT
#include "render_trees.h"

#include "libvkt/render/passes.h"
#include "libvkt/render/tree_merge.h"

#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

TEST(RenderTree, FurnaceIsExactlyOne) {
    for (Volume const& volume : {small_tree(), sphere_tree()}) {
        RenderSettings s = colourful();
        s.algorithm = Algorithm::multi_scattering;
        s.samples = 12;
        s.lut.clear();
        s.transfer = flat_transfer({1, 1, 1}, 0.3, 1);
        for (double const anisotropy : {0.0, 0.8}) {
            s.anisotropy = anisotropy;
            Picture const picture = render_one(volume, s);
            EXPECT_EQ(picture.report.capped, 0);
            for (std::size_t i = 0; i < picture.image.pixels.size(); i += 4)
                for (std::size_t c = 0; c < 3; ++c)
                    ASSERT_FLOAT_EQ(picture.image.pixels[i + c] + picture.image.pixels[i + 3], 1.0F) << anisotropy;
        }
    }
}

// Paths through a tree have the mean of those through its finest grid: 24 x 24 pixels of 1000 paths each, whose
// variance is at most a quarter.
TEST(RenderTree, PathsConvergeToThoseOfTheFinestGrid) {
    Volume const tree = small_tree(), grid = resampled(tree);
    RenderSettings s = colourful();
    s.width = s.height = 24;
    s.algorithm = Algorithm::multi_scattering;
    s.lut = {1, 0.5, 0.2, 0, 0.4, 0.6, 0.8, 0.05, 0.9, 0.9, 0.3, 0.4};
    s.domain = "0:1.5";
    s.samples = 1000;
    Picture const a = render_one(tree, s);
    s.seed = 9;
    Picture const b = render_one(grid, s);
    double squares = 0;
    std::array<double, 4> mean{};
    for (std::size_t i = 0; i < a.image.pixels.size(); ++i) {
        double const p = a.image.pixels[i], q = b.image.pixels[i], middle = (p + q) / 2;
        double const variance = 2 * std::max(middle * (1 - middle), 1e-3) / 1000;
        squares += (p - q) * (p - q) / variance;
        mean[i % 4] += (p - q) / (24 * 24);
    }
    // The grid's own interpolation of coarse cells differs by less than what the paths do.
    EXPECT_LT(squares / static_cast<double>(a.image.pixels.size()), 1.3);
    for (double const m : mean) EXPECT_LT(std::abs(m), 4 * std::sqrt(0.5 / (24.0 * 24 * 1000)) + 2e-3);
}

// Where nothing can be seen nobody looks: fewer values than segments that a grid's majorant would ask for.
TEST(RenderTree, PathsLeaveOutEmptySpace) {
    Volume const tree = amr_test::make_tree({64, 64, 64}, tiles_of({64, 64, 64}, {8, 8, 8}), [](Vec3 p) {
        return std::max(0.0, 6 - std::hypot(p.x - 20, p.y - 40, p.z - 30));
    });
    RenderSettings s = colourful();
    s.algorithm = Algorithm::multi_scattering;
    s.samples = 4;
    s.domain = "0:6";
    s.lut = {1, 1, 1, 0, 1, 1, 1, 0.9};
    Picture const picture = render_one(tree, s);
    EXPECT_GT(picture.report.skipped, 0.9);
    EXPECT_LT(picture.report.samples, picture.report.segments); // most paths miss the ball
}

TEST(RenderTree, TheExactReferenceIsThatOfTheStructuredVolume) {
    Volume const plain = blobs({21, 18, 25}, DataType::float32);
    RenderSettings s = colourful();
    s.exact = true;
    s.shade = 0;
    for (Index3 const edge : {Index3{8, 8, 8}, Index3{5, 11, 3}})
        EXPECT_LT(greatest_difference(render_one(plain, s).image, render_one(cut<float>(plain, edge), s).image), 1e-6);
}

// What the march converges to, also where levels meet: its error falls by four with each halving of its step, and by
// extrapolation it is a hundredth of a level away.
TEST(RenderTree, TheMarchConvergesToTheExactReference) {
    Volume const tree = small_tree();
    RenderSettings s = colourful();
    s.width = 40, s.height = 32;
    s.domain = "0:1.5";
    s.shade = 0;
    s.exact = true;
    Image const exact = render_one(tree, s).image;
    s.exact = false;
    auto const off = [&](double step) {
        s.step = step;
        Image const marched = render_one(tree, s).image;
        double sum = 0;
        for (std::size_t i = 0; i < marched.pixels.size(); ++i) {
            double const d = static_cast<double>(marched.pixels[i]) - static_cast<double>(exact.pixels[i]);
            sum += d * d;
        }
        return std::sqrt(sum / static_cast<double>(marched.pixels.size()));
    };
    double const coarse = off(0.5), fine = off(1.0 / 16);
    EXPECT_LT(fine, 2e-5);
    EXPECT_LT(fine, coarse / 8);
}

TEST(RenderTree, ProjectionsAreThoseOfTheStructuredVolume) {
    Volume const plain = blobs({21, 18, 25}, DataType::float32);
    for (Algorithm const algorithm : {Algorithm::maximum, Algorithm::minimum, Algorithm::mean}) {
        RenderSettings s = colourful();
        s.lut.clear();
        s.algorithm = algorithm;
        EXPECT_LT(greatest_difference(render_one(plain, s).image, render_one(cut<float>(plain, {8, 8, 8}), s).image),
                  2e-6);
    }
}

TEST(RenderTree, ThreadsAndInstructionSetsChangeNoBitOfAnyAlgorithm) {
    Volume const volume = small_tree();
    for (Algorithm const algorithm :
         {Algorithm::implicit_iso, Algorithm::multi_scattering, Algorithm::maximum, Algorithm::ray_marching}) {
        RenderSettings s;
        s.tree = TreeDrawing::bricks;
        s.width = 61, s.height = 47;
        s.algorithm = algorithm;
        s.samples = 3;
        s.exact = algorithm == Algorithm::ray_marching;
        if (s.exact) s.shade = 0;
        Execution one = amr_test::execution(1), three = amr_test::execution(3);
        Image const expected = render::render(volume, s, one);
        EXPECT_EQ(expected.pixels, render::render(volume, s, three).pixels) << static_cast<int>(algorithm);
        three.instructions = InstructionSet::baseline;
        EXPECT_EQ(expected.pixels, render::render(volume, s, three).pixels) << static_cast<int>(algorithm);
    }
}

TEST(RenderTree, GoalsAreMet) {
    Volume const volume = small_tree();
    RenderSettings s;
    s.tree = TreeDrawing::bricks;
    s.width = s.height = 48;
    for (Algorithm const algorithm : {Algorithm::ray_marching, Algorithm::implicit_iso}) {
        s.algorithm = algorithm;
        s.goal = {};
        s.goal.tolerance = 2;
        s.step = 1;
        Picture const picture = render_one(volume, s);
        EXPECT_EQ(picture.report.quality.above, 0) << static_cast<int>(algorithm);
        EXPECT_GT(picture.report.quality.rays, 1);
    }
    s.algorithm = Algorithm::multi_scattering;
    s.goal = {};
    s.goal.noise = 4;
    s.samples = most_paths;
    Picture const noisy = render_one(volume, s);
    EXPECT_LT(noisy.report.quality.error, 4);
    s.goal.noise = 0;
    s.goal.seconds = 0.2;
    EXPECT_GT(render_one(volume, s).report.quality.rays, 0.9);
}

TEST(RenderTree, JoinedBricksHoldTheSameCells) {
    Volume const volume = small_tree();
    JoinedBricks const joined = join_bricks(volume, amr_test::execution());
    ASSERT_LE(2 * joined.volume.bricks().size(), volume.bricks().size());
    validate_tree(volume.header().dims, joined.volume.bricks(), Coverage::complete);
    for (Brick const& brick : joined.volume.bricks())
        for (int a = 0; a < 3; ++a) EXPECT_LE(brick.dims[a], widest_joined);
    TreeSampler const one(volume), other(joined.volume);
    std::mt19937 random(11);
    std::uniform_real_distribution<> share(0, 1);
    Index3 const dims = volume.header().dims;
    for (int i = 0; i < 20000; ++i) {
        Vec3 const p{share(random) * static_cast<double>(dims.x), share(random) * static_cast<double>(dims.y),
                     share(random) * static_cast<double>(dims.z)};
        TreeSample const a = one.sample(p), b = other.sample(p);
        EXPECT_NEAR(a.value, b.value, 1e-6F * std::abs(a.value) + 1e-6F);
        EXPECT_NEAR(a.weight, b.weight, 1e-6F);
    }
    for (std::size_t b = 0; b < volume.bricks().size(); ++b) {
        Brick const &brick = volume.bricks()[b],
                    &whole = joined.volume.bricks()[static_cast<std::size_t>(joined.into[b])];
        EXPECT_EQ(brick.level, whole.level);
        EXPECT_EQ(intersect(bounds_of(brick, dims), bounds_of(whole, dims)), bounds_of(brick, dims));
    }
    // What cannot be joined is left as it is.
    Volume const lone = amr_test::make_tree({16, 16, 16}, {{{0, 0, 0}, {16, 16, 16}, 0}}, [](Vec3) { return 1.0; });
    EXPECT_EQ(join_bricks(lone, amr_test::execution()).volume.bricks().size(), 1U);
}

} // namespace
