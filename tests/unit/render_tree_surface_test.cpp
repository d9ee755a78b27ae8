// Surfaces of hierarchical volumes and the pieces that rays are cut into: against structured volumes that hold the
// same, closed forms, and parity.
// SPDX-License-Identifier: MIT
#include "render_trees.h"

#include "libvkt/render/inner/iso.h"
#include "libvkt/render/inner/tree_pieces.h"

#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

TEST(RenderTree, OneLevelHasTheSurfacesOfTheStructuredVolume) {
    Volume const plain = blobs({37, 29, 45}, DataType::float32);
    for (Volume const& volume : {plain, with_geometry(plain, skewed())})
        for (Index3 const edge : {Index3{8, 8, 8}, Index3{37, 29, 45}, Index3{5, 11, 3}}) {
            RenderSettings s = colourful();
            s.algorithm = Algorithm::implicit_iso;
            s.isos = {60.5, 120.25};
            s.iso_opacities = {0.4, 1};
            s.layers = true;
            for (bool const lamp : {false, true}) {
                if (lamp) s.light_direction = Vec3{1, -0.5, 0.7}, s.shadows = true;
                Picture const lattice = render_one(volume, s), tree = render_one(cut<float>(volume, edge), s);
                int apart = 0;
                for (std::size_t i = 0; i < lattice.image.pixels.size(); ++i)
                    apart += std::abs(lattice.image.pixels[i] - tree.image.pixels[i]) > 2e-4F ? 1 : 0;
                // The edge of a shadow and a silhouette are where rounding decides.
                EXPECT_LE(apart, 16) << edge.x << " " << lamp;
                for (char const* name : {"Z", "normal.X", "albedo.G"}) {
                    auto const &one = layer(lattice.report, name).values, &other = layer(tree.report, name).values;
                    int off = 0;
                    for (std::size_t i = 0; i < one.size(); ++i)
                        off += one[i] == other[i] || std::abs(one[i] - other[i]) < 2e-3F ? 0 : 1;
                    EXPECT_LE(off, 4) << name << " " << edge.x;
                }
            }
        }
}

TEST(RenderTree, SurfacesOfASphereAreWhereTheyBelong) {
    Volume const tree = sphere_tree();
    RenderSettings s = orthographic("z", 64, 64);
    s.camera.fit = Fit::volume;
    s.camera.span = 64;
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {20};
    s.shade = 1;
    s.layers = true;
    Picture const picture = render_one(tree, s);
    auto const& depth = layer(picture.report, "Z").values;
    double least = std::numeric_limits<double>::infinity();
    for (float const d : depth) least = std::min(least, static_cast<double>(d));
    double worst = 0, worst_normal = 0;
    int met = 0;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) {
            auto const i = static_cast<std::size_t>(64 * y + x);
            double const u = x + 0.5 - 32, v = y + 0.5 - 32, r2 = u * u + v * v;
            EXPECT_EQ(std::isfinite(depth[i]), r2 < 400) << x << " " << y;
            if (!(r2 < 324)) continue;
            ++met;
            // Depth below the top of the sphere.
            worst = std::max(worst, std::abs((static_cast<double>(depth[i]) - least) - (20 - std::sqrt(400 - r2))));
            double const nz = std::abs(static_cast<double>(layer(picture.report, "normal.Z").values[i]));
            worst_normal = std::max(worst_normal, std::abs(nz - std::sqrt(400 - r2) / 20));
        }
    EXPECT_GT(met, 1000);
    // Trilinear values of a distance are off by up to 1/(4 R) of a cell; the top lies between rays.
    EXPECT_LT(worst, 0.04);
    EXPECT_LT(worst_normal, 0.004);
}

// Far from other levels the picture is that of the tree on its finest grid, up to what a coarse cell's own
// interpolation bends between the points of the fine grid.
TEST(RenderTree, SurfacesOfLevelsAreThoseOfTheFinestGrid) {
    Volume const tree = sphere_tree(), grid = resampled(tree);
    RenderSettings s = orthographic("oblique", 80, 80);
    s.camera.fit = Fit::volume;
    s.algorithm = Algorithm::implicit_iso;
    s.shade = 1;
    s.layers = true;
    for (double const iso : {20.0, 30.0, 7.0}) { // through fine cells, through both, through coarse ones
        s.isos = {iso};
        Picture const a = render_one(tree, s), b = render_one(grid, s);
        auto const &one = layer(a.report, "Z").values, &other = layer(b.report, "Z").values;
        double sum = 0;
        int met = 0, differ = 0;
        for (std::size_t i = 0; i < one.size(); ++i) {
            if (std::isfinite(one[i]) != std::isfinite(other[i])) ++differ;
            if (!std::isfinite(one[i]) || !std::isfinite(other[i])) continue;
            double const off = static_cast<double>(std::abs(one[i] - other[i]));
            sum += std::min(off, 5.0);
            ++met;
        }
        ASSERT_GT(met, 100);
        EXPECT_LT(sum / met, iso == 20 ? 2e-3 : 0.12) << iso; // finest cells
        EXPECT_LE(differ, met / 50 + 2) << iso;
    }
}

TEST(RenderTree, PiecesHoldTheReconstruction) {
    Tree const tree(small_tree(), false, amr_test::execution());
    Volume const volume = join_bricks(small_tree(), amr_test::execution()).volume; // what rays sample
    TreeSampler const sampler(volume);
    TransferTable const table({{0, 0, 1, 1, 1}, {1, 1, 1, 1, 1}});
    Tree::Visibility const visibility = tree.classify(table);
    TreeView const view = tree.view(visibility);
    CellVisibility const cells = classify_cells(tree.cells().grid, table);
    SceneView scene{};
    scene.cells = view_of(tree.cells().grid, cells);
    Index3 const dims = volume.header().dims;
    scene.shown.upper = {static_cast<double>(dims.x), static_cast<double>(dims.y), static_cast<double>(dims.z)};
    TreeScratch scratch;
    TreePoints<float, TreeScratch> const points{view, scene.cells, scene.shown.lower, scene.shown.upper, scratch};
    std::mt19937 random(5);
    std::uniform_real_distribution<> share(0, 1);
    int plain = 0, mixed = 0;
    for (int r = 0; r < 200; ++r) {
        auto const point = [&] {
            return Double3{share(random) * scene.shown.upper.x, share(random) * scene.shown.upper.y,
                           share(random) * scene.shown.upper.z};
        };
        Double3 const a = point(), way = point() - a;
        double const length = std::sqrt(dot(way, way));
        Ray const ray{a, way * (1 / length), length, 1};
        double at = 0;
        each_piece(points, scene, ray, false, [&](TreePiece const& piece) {
            EXPECT_NEAR(piece.t, at, 1e-9);
            at = piece.t + piece.width;
            (piece.plain ? plain : mixed) += 1;
            EXPECT_FALSE(piece.missing);
            piece.each_cubic([&](Cubic const& f, double from, double to) {
                for (double const s : {0.1, 0.4, 0.95}) {
                    Double3 const p = ray.entry + ray.direction * (piece.t + (from + s * (to - from)) * piece.width);
                    auto const value = sampler.sample({p.x, p.y, p.z}).value;
                    EXPECT_NEAR(f(s), static_cast<double>(value), 1e-5 + 1e-6 * static_cast<double>(value));
                    EXPECT_EQ(points.value(p), value);
                }
                return true;
            });
            return true;
        });
        EXPECT_NEAR(at, length, 1e-9);
    }
    EXPECT_GT(plain, 1000);
    EXPECT_GT(mixed, 1000);
    scratch.release();
}

// The number of crossings between two points is even if and only if both lie on one side.
TEST(RenderTree, CrossingsHaveTheRightParity) {
    Index3 const dims{48, 32, 32};
    std::mt19937 random(7);
    std::uniform_real_distribution<> share(0, 1);
    std::vector<Brick> bricks = tiles_of({16, 32, 32}, {8, 8, 8});
    for (Brick const& b : tiles_of({16, 16, 16}, {8, 8, 8}))
        bricks.push_back({{16 + 2 * b.lower.x, 2 * b.lower.y, 2 * b.lower.z}, b.dims, 1});
    Volume const volume = amr_test::make_tree(dims, bricks, [&](Vec3) { return share(random); });
    Tree const tree(volume, false, amr_test::execution());
    TransferTable const table({{0, 0, 1, 1, 1}, {1, 1, 1, 1, 1}});
    Tree::Visibility const visibility = tree.classify(table);
    TreeView const view = tree.view(visibility);
    double const iso = 0.5;
    CellVisibility const cells = classify_cells(tree.cells().grid, std::vector<IsoView>{{0.5F, 1, 1, 1}});
    SceneView scene{};
    scene.cells = view_of(tree.cells().grid, cells);
    scene.skip = true;
    scene.shown.upper = {48, 32, 32};
    TreeScratch scratch;
    TreePoints<float, TreeScratch> const points{view, scene.cells, scene.shown.lower, scene.shown.upper, scratch};
    int odd = 0;
    for (int r = 0; r < 20000; ++r) {
        auto const point = [&] { return Double3{48 * share(random), 32 * share(random), 32 * share(random)}; };
        Double3 const a = point(), b = point(), way = b - a;
        auto const fa = static_cast<double>(points.value(a)), fb = static_cast<double>(points.value(b));
        if (std::abs(fa - iso) < 1e-5 || std::abs(fb - iso) < 1e-5) continue; // rounding decides
        double const length = std::sqrt(dot(way, way));
        int crossings = 0;
        Counters counters;
        cross_ray(points, scene, Ray{a, way * (1 / length), length, 1}, iso, counters, [&](double, Side) {
            ++crossings;
            return true;
        });
        ASSERT_EQ(crossings % 2 == 1, (fa >= iso) != (fb >= iso)) << r;
        odd += crossings % 2;
    }
    EXPECT_GT(odd, 5000);
    scratch.release();
}

TEST(RenderTree, HolesAndMissingCellsHaveNoSurface) {
    Index3 const dims{32, 32, 32};
    Volume holes = amr_test::make_tree(dims, {{{0, 0, 0}, {32, 32, 8}, 0}, {{0, 0, 24}, {32, 32, 8}, 0}},
                                       [](Vec3 p) { return p.x; });
    RenderSettings s = orthographic("-y", 40, 40);
    s.camera.fit = Fit::volume;
    s.camera.span = 32;
    s.shade = 1;
    s.algorithm = Algorithm::implicit_iso;
    s.isos = {16.25};
    s.layers = true;
    s.camera.view = "x";
    Picture const picture = render_one(holes, s);
    auto const& depth = layer(picture.report, "Z").values;
    // Rows of the picture are z: in the hole, but for half a cell at either side, there is nothing.
    int met = 0;
    for (std::size_t y = 0; y < 40; ++y)
        for (std::size_t x = 0; x < 40; ++x) {
            double const z = 32 - (static_cast<double>(y) + 0.5) * 0.8;
            bool const there = z < 8.5 || z > 23.5;
            EXPECT_EQ(std::isfinite(depth[40 * y + x]), there) << z;
            met += there ? 1 : 0;
        }
    EXPECT_GT(met, 500);
    auto* const cells = reinterpret_cast<float*>(holes.buffer().write(Space::host));
    for (int i = 0; i < 32 * 32 * 8; ++i) cells[i] = std::numeric_limits<float>::quiet_NaN();
    for (float const p : render_one(holes, s).image.pixels) EXPECT_TRUE(std::isfinite(p));
    s.algorithm = Algorithm::multi_scattering;
    for (float const p : render_one(holes, s).image.pixels) EXPECT_TRUE(std::isfinite(p));
}

} // namespace
