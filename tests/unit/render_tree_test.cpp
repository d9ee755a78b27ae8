// Rendering of hierarchical volumes: against structured ones that hold the same, and against themselves.
// SPDX-License-Identifier: MIT
#include "render_trees.h"

#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/inner/tree_field.h"

#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

TEST(RenderTree, OneLevelLooksLikeTheStructuredVolume) {
    Volume const plain = blobs({37, 29, 45}, DataType::float32);
    for (Volume const& volume : {plain, with_geometry(plain, skewed())})
        for (Index3 const edge : {Index3{8, 8, 8}, Index3{37, 29, 45}, Index3{5, 11, 3}})
            for (double const shade : {0.0, 0.8})
                for (double const step : {0.5, 0.23}) {
                    RenderSettings s = colourful();
                    s.shade = shade, s.step = step;
                    Picture const lattice = render_one(volume, s), tree = render_one(cut<float>(volume, edge), s);
                    EXPECT_LT(greatest_difference(lattice.image, tree.image), shade > 0 ? 2e-5 : 5e-6)
                        << edge.x << " " << shade << " " << step;
                    EXPECT_GE(lattice.report.segments, tree.report.segments);
                }
    // All that is chosen from the data is chosen alike.
    RenderSettings automatic;
    automatic.tree = TreeDrawing::bricks;
    automatic.width = automatic.height = 64;
    automatic.camera.fit = Fit::volume;
    Picture const lattice = render_one(plain, automatic), tree = render_one(cut<float>(plain, {8, 8, 8}), automatic);
    EXPECT_EQ(lattice.report.transfer, tree.report.transfer);
    EXPECT_LT(greatest_difference(lattice.image, tree.image), 2e-4);
}

TEST(RenderTree, EveryTypeLooksLikeTheStructuredVolume) {
    RenderSettings s = colourful();
    s.shade = 0;
    auto const compare = [&]<class T>(T, DataType type) {
        Volume const volume = blobs({21, 18, 25}, type);
        EXPECT_LT(greatest_difference(render_one(volume, s).image, render_one(cut<T>(volume, {8, 8, 8}), s).image),
                  5e-6)
            << name_of(type);
    };
    compare(std::uint8_t{}, DataType::uint8);
    compare(std::uint16_t{}, DataType::uint16);
    compare(std::int16_t{}, DataType::int16);
    compare(float{}, DataType::float32);
    compare(double{}, DataType::float64);
}

// One cell far off must not cost the others their differences, neither where they lie around zero nor far from it.
TEST(RenderTree, OutliersHideNothing) {
    for (double const base : {0.0, 1e12}) {
        Volume plain = blobs({24, 24, 24}, DataType::float64);
        auto* const cells = reinterpret_cast<double*>(plain.buffer().write(Space::host));
        for (std::int64_t i = 0; i < plain.header().voxels(); ++i) cells[i] += base;
        RenderSettings s = colourful();
        s.camera.view = "-y";
        s.camera.projection = Projection::orthographic;
        s.domain = text(base, ":", base + 200);
        s.shade = 0.8;
        Image const expected = render_one(plain, s).image;
        EXPECT_LT(expected.at(38, 15)[3], 0.7);
        for (double const outlier : {1e10, -1e10, 1e300, -1e300}) {
            cells[0] = outlier;
            for (Volume const& volume : {plain, cut<double>(plain, {8, 8, 8})}) {
                Image const image = render_one(volume, s).image;
                int differ = 0;
                for (int y = 0; y < image.height; ++y)
                    for (int x = 0; x < image.width; ++x)
                        for (int c = 0; c < 4; ++c)
                            if (!(std::abs(image.at(x, y)[c] - expected.at(x, y)[c]) < 2e-3)) {
                                ++differ;
                                break;
                            }
                EXPECT_LT(differ, 20) << base << " " << outlier; // of 2867: those of the cell itself
            }
        }
    }
}

/// A fine half at low x and a coarse one, with a linear field.
Volume ramp_tree(Index3 dims, Vec3 slope) {
    std::vector<Brick> bricks = tiles_of({dims.x / 2, dims.y, dims.z}, {8, 8, 8});
    for (Brick const& b : tiles_of({dims.x / 4, dims.y / 2, dims.z / 2}, {8, 8, 8}))
        bricks.push_back({{dims.x / 2 + 2 * b.lower.x, 2 * b.lower.y, 2 * b.lower.z}, b.dims, 1});
    return amr_test::make_tree(dims, bricks, [=](Vec3 p) { return slope.x * p.x + slope.y * p.y + slope.z * p.z; });
}

// The reconstruction of a linear field is off by half a fine cell at most where levels meet and exact elsewhere; along
// a ray that is a small part of the way. Borders of the volume are left out: half a cell there is constant.
TEST(RenderTree, ALinearRampHasNoSeam) {
    Index3 const dims{64, 48, 48};
    for (Vec3 const slope : {Vec3{1, 0, 0}, Vec3{0.3, 1, 0.2}}) {
        Volume const grid = volume_of(dims, {1, 1, 1}, [=](double x, double y, double z) {
            return slope.x * (x + 0.5) + slope.y * (y + 0.5) + slope.z * (z + 0.5);
        });
        Volume const tree = ramp_tree(dims, slope);
        for (char const* view : {"-y", "z", "oblique"})
            for (double const shade : {0.0, 1.0}) {
                RenderSettings s = orthographic(view, 80, 80);
                s.shade = shade;
                s.domain = "0:60";
                s.lut = {1, 0.2, 0.1, 0.004, 0.2, 0.9, 1, 0.03};
                Picture const a = render_one(grid, s), b = render_one(tree, s);
                double worst = 0;
                for (int y = 20; y < 60; ++y)
                    for (int x = 20; x < 60; ++x)
                        for (int c = 0; c < 4; ++c)
                            worst = std::max(worst, std::abs(static_cast<double>(a.image.at(x, y)[c]) -
                                                             static_cast<double>(b.image.at(x, y)[c])));
                // Central differences are off by a quarter next to the boundary, which shading shows.
                EXPECT_LT(worst, shade > 0 ? 0.05 : 0.01) << view << " " << slope.x;
                EXPECT_LT(b.report.samples, a.report.samples); // long steps where cells are large
            }
    }
}

TEST(RenderTree, SkippingThreadsAndInstructionSetsChangeNoBit) {
    Volume const whole = small_tree();
    std::vector<Brick> some;
    for (std::size_t i = 0; i < whole.bricks().size(); ++i)
        if (i % 7 != 3) some.push_back(whole.bricks()[i]);
    Volume const holes =
        amr_test::make_tree(whole.header().dims, some, [](Vec3 p) { return std::sin(p.x / 5) + std::cos(p.y / 7); });
    for (Volume const& volume : {whole, holes})
        for (double const step : {0.23, 1.0, 3.7})
            for (bool const banded : {false, true}) {
                RenderSettings s;
                s.tree = TreeDrawing::bricks;
                s.width = 61, s.height = 47;
                s.step = step;
                s.shade = 0.7;
                if (banded)
                    s.lut = {1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.9, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1, 1};
                auto const [with, without] = expect_no_bit_changes(volume, s, text(step, " ", banded ? "banded" : ""));
                EXPECT_LE(with.samples, without.samples);
            }
}

TEST(RenderTree, BatchesAreTheSumsOfSingleSamples) {
    Tree const tree(small_tree(), false, amr_test::execution());
    Volume const volume = join_bricks(small_tree(), amr_test::execution()).volume; // what rays sample
    TreeSampler const sampler(volume);
    TransferTable const table({{0, 0, 1, 1, 1}, {1, 1, 1, 1, 1}});
    Tree::Visibility const visibility = tree.classify(table);
    TreeView const view = tree.view(visibility);
    TreeScratch scratch;
    std::mt19937 random(3);
    std::uniform_real_distribution<> share(0, 1);
    Index3 const dims = volume.header().dims;
    for (int ray = 0; ray < 300; ++ray) {
        Double3 const o{share(random) * static_cast<double>(dims.x), share(random) * static_cast<double>(dims.y),
                        share(random) * static_cast<double>(dims.z)};
        Double3 const d{share(random) - 0.5, share(random) - 0.5, share(random) - 0.5};
        TreeField<float> field{view, scratch.near, {}, {}, {}, 0, {}};
        double t[chunk];
        for (int k = 0; k < chunk; ++k) t[k] = 0.7 * k;
        if (ray % 2 == 0) {
            for (std::size_t b = 0; b < volume.bricks().size(); ++b) {
                for (int k = 0; k < chunk; ++k) {
                    Vec3 const p{o.x + d.x * t[k], o.y + d.y * t[k], o.z + d.z * t[k]};
                    if (domain_meets(volume.bricks()[b], dims, p - Vec3{1, 1, 1}, p + Vec3{1, 1, 1}))
                        field.include(static_cast<std::int32_t>(b));
                }
            }
        } else {
            field.count = TreeField<float>::most + 1; // too many to hold
        }
        float values[chunk];
        field.values(o, d, t, values);
        for (int k = 0; k < chunk; ++k) {
            TreeSample const s = sampler.sample({o.x + d.x * t[k], o.y + d.y * t[k], o.z + d.z * t[k]});
            if (s.weight > 0)
                EXPECT_EQ(values[k], s.value);
            else
                EXPECT_TRUE(std::isnan(values[k]));
        }
    }
    scratch.release();
}

TEST(RenderTree, HolesAreEmpty) {
    Index3 const dims{32, 32, 32};
    Volume const volume = amr_test::make_tree(dims, {{{0, 0, 0}, {32, 32, 8}, 0}, {{0, 0, 24}, {32, 32, 8}, 0}},
                                              [](Vec3) { return 1.0; });
    RenderSettings s = orthographic("z", 20, 20);
    s.transfer = flat_transfer({1, 1, 1}, 0.05, 1);
    s.step = 0.125;
    Picture const picture = render_one(volume, s);
    // Two layers of 8 cells; each reaches half a cell into the hole.
    double const expected = std::exp(-extinction_of(0.05) * 17);
    EXPECT_NEAR(picture.center()[3], expected, 0.02 * expected);
    s.skip = false;
    EXPECT_EQ(picture.image.pixels, render_one(volume, s).image.pixels);
    for (float const p : picture.image.pixels) EXPECT_TRUE(std::isfinite(p));
}

TEST(RenderTree, MissingAndInfiniteCells) {
    Volume volume = small_tree();
    auto* cells = reinterpret_cast<float*>(volume.buffer().write(Space::host));
    for (int i = 0; i < 3000; ++i) cells[i * 7] = std::numeric_limits<float>::quiet_NaN();
    cells[5] = std::numeric_limits<float>::infinity();
    cells[6000] = -std::numeric_limits<float>::infinity();
    RenderSettings s;
    s.tree = TreeDrawing::bricks;
    s.width = s.height = 50;
    Picture const picture = render_one(volume, s);
    EXPECT_EQ(picture.report.missing, 3000);
    EXPECT_EQ(picture.report.infinite, 2);
    for (float const p : picture.image.pixels) EXPECT_TRUE(std::isfinite(p));
    s.skip = false;
    EXPECT_EQ(picture.image.pixels, render_one(volume, s).image.pixels);
    for (std::int64_t i = 0; i < volume.header().voxels(); ++i) cells[i] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(render_one(volume, s), Error);
}

TEST(RenderTree, FarAwayIsAsPreciseAsNear) {
    auto const field = [](Vec3 p) { return std::sin(p.x / 3) * std::cos(p.y / 4) + p.z / 40; };
    auto const drawn = [&](std::int64_t away) {
        std::vector<Brick> bricks = tiles_of({32, 32, 32}, {8, 8, 8});
        for (Brick& b : bricks) b.lower.z += away;
        auto const shift = static_cast<double>(away);
        Volume const volume = amr_test::make_tree({32, 32, away + 32}, bricks, [=](Vec3 p) {
            return field(p - Vec3{0, 0, shift});
        });
        RenderSettings s = colourful();
        s.camera.eye = Vec3{14, 19, shift - 50}, s.camera.target = Vec3{16, 16, shift + 16};
        s.camera.up = Vec3{0, 1, 0};
        s.shade = 0.8;
        return render_one(volume, s).image;
    };
    EXPECT_LT(greatest_difference(drawn(64), drawn(std::int64_t{1} << 26)), 1e-4);
}

TEST(RenderTree, NamesOfAxesDoNotMatter) {
    Volume volume = small_tree();
    RenderSettings s;
    s.tree = TreeDrawing::bricks;
    s.width = 61, s.height = 47;
    s.domain = "0:2";
    s.opacity = "0,0.01,0.1";
    s.shade = 0.8;
    Image const image = render_one(volume, s).image;
    for (auto const& axis : amr_test::permutations())
        EXPECT_LT(greatest_difference(image, render_one(amr_test::permuted(volume, axis), s).image), 1e-4);
}

TEST(RenderTree, FlatTreesAreDrawn) {
    AmrRecipe recipe = amr_test::small_recipe();
    recipe.roots = {3, 2, 1}, recipe.block = {8, 4, 1};
    Volume const volume = make_amr(recipe, amr_test::execution());
    ASSERT_EQ(volume.header().dims.z, 1);
    RenderSettings s = orthographic("z", 40, 40);
    s.transfer = flat_transfer({1, 1, 1}, 0.5, 1);
    Picture const picture = render_one(volume, s);
    EXPECT_NEAR(picture.center()[3], 0.5, 1e-5);
}

// A tree of small bricks is drawn as the grid that the basis reconstruction makes of it, bit for bit; one that would be
// larger so, or that has holes, brick by brick.
TEST(RenderTree, IsDrawnAsAGridWhereThatIsSmaller) {
    Volume const tree = sphere_tree();
    SampleGrid grid;
    grid.dims = tree.header().dims;
    Volume const cells = reconstruct(tree, grid, Reconstruction::basis, 0, amr_test::execution());
    for (double const shade : {0.0, 0.8}) {
        RenderSettings s = colourful();
        s.shade = shade;
        Picture const bricks = render_one(tree, s);
        s.tree = TreeDrawing::automatic;
        Picture const chosen = render_one(tree, s);
        EXPECT_EQ(chosen.image.pixels, render_one(cells, s).image.pixels);
        EXPECT_NE(chosen.report.method.find("finest grid"), std::string::npos) << chosen.report.method;
        // What is interpolated between coarse cells is not quite what is interpolated between points of that.
        EXPECT_LT(greatest_difference(bricks.image, chosen.image), shade > 0 ? 0.05 : 0.01);
        EXPECT_GT(greatest_difference(bricks.image, chosen.image), 0);
    }
    std::vector<Brick> some = tree.bricks().list();
    some.pop_back();
    RenderSettings s = colourful();
    s.tree = TreeDrawing::automatic;
    for (Volume const& volume :
         {amr_test::make_tree(tree.header().dims, some, [](Vec3) { return 1; }),
          amr_test::make_tree({256, 256, 256}, {{{0, 0, 0}, {8, 8, 8}, 5}}, [](Vec3 p) { return p.x; })})
        EXPECT_EQ(render_one(volume, s).report.method.find("finest grid"), std::string::npos);
}

} // namespace
