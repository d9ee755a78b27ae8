// What GPUs do with the bricks of a ray, which keep no lists, beside what CPUs do: the same light, surfaces, paths.
// SPDX-License-Identifier: MIT
#include "render_trees.h"

#include "libvkt/core/text.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/inner/iso.h"
#include "libvkt/render/inner/piece_walk.h"
#include "libvkt/render/inner/project.h"
#include "libvkt/render/inner/scatter.h"
#include "libvkt/render/inner/segment_march.h"
#include "libvkt/render/inner/tree_march.h"
#include "libvkt/render/inner/tree_pieces.h"

#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

/// A tree of floats with all that rays see of it.
struct Scene {
    Tree tree;
    std::vector<Knot> knots{{0, 0, 0, 0, 0}, {0.3, 0, 1, 0.5, 0}, {0.5, 0.2, 0, 0.5, 1}, {1, 0.02, 1, 1, 1}};
    TransferTable table;
    Tree::Visibility bricks;
    CellVisibility cells;
    StoredBlocks stored;
    TreeView view;
    SceneView scene{};
    TreeScratch scratch;
    NoScratch none;

    Scene(Volume const& volume, bool blocks, bool surfaces = false)
        : tree(volume, blocks, amr_test::execution()), table(scaled()), bricks(tree.classify(table)),
          cells(surfaces ? classify_cells(tree.cells().grid, std::vector<IsoView>{{middle(), 1, 1, 1}})
                         : classify_cells(tree.cells().grid, table)),
          stored(blocks ? tree.blocks(cells, table, true, std::size_t{1} << 30, 2) : StoredBlocks{}),
          view(tree.view(bricks, stored)) {
        scene.cells = view_of(tree.cells().grid, cells);
        scene.table = table.view();
        scene.knots = knots.data();
        scene.knot_count = static_cast<int>(knots.size());
        Box const region = tree.region();
        for (auto [to, from] : {std::pair{&scene.shown.lower, region.lower}, {&scene.shown.upper, region.upper}})
            *to = {static_cast<double>(from.x), static_cast<double>(from.y), static_cast<double>(from.z)};
        scene.to_lattice = scene.to_world = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        scene.shade = {0.8F, 0.3F, 0.2F, 5 / static_cast<float>(tree.histogram().greatest), 1, {1, 1, 1, 0, 0, 0}};
        scene.step = 0.5F;
        scene.skip = true;
        scene.isos[0] = {middle(), 1, 0.5F, 0.2F};
        scene.iso_count = 1;
        scene.bounces = 20;
        scene.albedo = 0.9F;
        for (float& light : scene.light) light = 1;
    }
    ~Scene() { scratch.release(); }
    Scene(Scene const&) = delete;
    Scene& operator=(Scene const&) = delete;

    float middle() const { return static_cast<float>(0.5 * (tree.histogram().least + tree.histogram().greatest)); }
    std::vector<Knot> const& scaled() {
        double const least = tree.histogram().least, width = tree.histogram().greatest - least;
        for (Knot& knot : knots) knot.value = least + width * knot.value;
        return knots;
    }
    TreePoints<float, TreeScratch> listed() {
        return {view, scene.cells, scene.shown.lower, scene.shown.upper, scratch};
    }
    TreePoints<float, NoScratch> unlisted() { return {view, scene.cells, scene.shown.lower, scene.shown.upper, none}; }
};

/// visit(ray) for rays through what is shown, some of them along axes and some through the corners of cells.
template <class Visit> void for_some_rays(Scene const& scene, int count, Visit visit) {
    std::mt19937 random(11);
    std::uniform_real_distribution<> share(0, 1);
    ShownPart const& shown = scene.scene.shown;
    for (int r = 0; r < count; ++r) {
        auto const point = [&] {
            double p[3];
            double const low[3] = {shown.lower.x, shown.lower.y, shown.lower.z},
                         high[3] = {shown.upper.x, shown.upper.y, shown.upper.z};
            for (int a = 0; a < 3; ++a) {
                p[a] = low[a] + share(random) * (high[a] - low[a]);
                if (r % 3 == 1) p[a] = std::floor(p[a]) + (r % 2) * 0.5;
            }
            return Double3{p[0], p[1], p[2]};
        };
        Double3 const a = point();
        Double3 way = point() - a;
        if (r % 4 == 1) way = {r % 8 == 1 ? 1.0 : 0.0, r % 8 == 1 ? 0.0 : -1.0, 0};
        double const norm = std::sqrt(dot(way, way));
        if (!(norm > 0)) continue;
        Ray ray{};
        ray.direction = way * (1 / norm);
        ray.world_per_lattice = 1;
        double near = -std::numeric_limits<double>::infinity(), far = std::numeric_limits<double>::infinity();
        if (!clip(a, ray.direction, shown, near, far)) continue;
        ray.entry = a + ray.direction * near;
        ray.length = far - near;
        visit(ray, r);
    }
}

void expect_same(Radiance const& a, Radiance const& b, double apart, int ray, std::string const& what) {
    EXPECT_NEAR(a.red, b.red, apart) << what << ", ray " << ray;
    EXPECT_NEAR(a.green, b.green, apart) << what << ", ray " << ray;
    EXPECT_NEAR(a.blue, b.blue, apart) << what << ", ray " << ray;
    EXPECT_NEAR(a.transmittance, b.transmittance, apart) << what << ", ray " << ray;
}

Volume with_holes() {
    Volume const whole = small_tree();
    std::vector<Brick> some;
    for (std::size_t b = 0; b < whole.bricks().size(); ++b)
        if (b % 5 != 2) some.push_back(whole.bricks()[b]);
    return amr_test::make_tree(whole.header().dims, some,
                               [](Vec3 p) { return std::sin(p.x / 5) + std::cos(p.y / 7) + p.z / 20; });
}

std::vector<Volume> trees() {
    std::vector<Volume> all;
    all.push_back(small_tree());
    all.push_back(with_holes());
    all.push_back(sphere_tree());
    all.push_back(cut<float>(blobs({20, 28, 24}, DataType::float32), {8, 8, 8}));
    all.push_back(amr_test::make_tree({32, 32, 32}, {{{0, 0, 0}, {32, 32, 8}, 0}, {{0, 0, 24}, {32, 32, 8}, 0}},
                                      [](Vec3 p) { return p.x + p.z; }));
    return all;
}

TEST(RenderUnlisted, MarchesAsListsDo) {
    int tree = 0, seen = 0;
    for (Volume const& volume : trees()) {
        for (bool const blocks : {false, true}) {
            if (blocks && (tree == 1 || tree == 4)) continue; // they have holes
            Scene all(volume, blocks);
            ASSERT_EQ(all.view.blocks.cells != nullptr, blocks);
            for (int variant = 0; variant < 8; ++variant) {
                SceneView& scene = all.scene;
                scene.skip = variant % 2 == 0;
                scene.shade.strength = variant % 4 < 2 ? 0.8F : 0.0F;
                scene.step = variant < 4 ? 0.5F : 1.7F;
                std::string const what = text("tree ", tree, blocks ? ", blocks" : ", bricks", ", variant ", variant);
                for_some_rays(all, 300, [&](Ray const& ray, int r) {
                    Counters one, other;
                    Radiance const a = march_ray(all.listed(), scene, ray, one),
                                   b = march_ray(all.unlisted(), scene, ray, other);
                    expect_same(a, b, 2e-6, r, what);
                    seen += a.transmittance < 0.99F ? 1 : 0;
                    if (a.transmittance > 0.01F) { // none of the last ones were left out
                        EXPECT_EQ(one.segments, other.segments) << what << ", ray " << r;
                    }
                });
            }
        }
        ++tree;
    }
    EXPECT_GT(seen, 3000);
}

TEST(RenderUnlisted, ShadowsAreTheSame) {
    for (bool const blocks : {false, true}) {
        Scene all(sphere_tree(), blocks);
        SceneView& scene = all.scene;
        scene.lamp = {true, true, {0.6, 0.8, 0}, {0.6, 0.8, 0}, {}};
        scene.ways[0] = {{0.6F, 0.8F, 0}, 1, 1e6F};
        scene.ways[1] = {{0, 0, 1}, 1, 8};
        scene.around_count = 1;
        for_some_rays(all, 100, [&](Ray const& ray, int r) {
            Counters one, other;
            expect_same(march_ray(all.listed(), scene, ray, one), march_ray(all.unlisted(), scene, ray, other), 2e-6, r,
                        blocks ? "blocks" : "bricks");
        });
    }
}

TEST(RenderUnlisted, CutsPiecesAsListsDo) {
    int tree = 0, met = 0;
    for (Volume const& volume : trees()) {
        Scene all(volume, false, true);
        SceneView& scene = all.scene;
        std::string const what = text("tree ", tree);
        for_some_rays(all, 300, [&](Ray const& ray, int r) {
            double at = 0, covered = 0;
            auto const points = all.unlisted();
            each_piece(points, scene, ray, false, [&](TreePiece const& piece) {
                EXPECT_NEAR(piece.t, at, 1e-9);
                at = piece.t + piece.width;
                if (piece.missing || !(piece.width > 1e-9)) return true;
                covered += piece.width;
                for (double const s : {0.1, 0.4, 0.95}) {
                    float const value = points.value(ray.entry + ray.direction * (piece.t + s * piece.width));
                    if (std::isnan(value)) continue; // on the border of a hole
                    EXPECT_NEAR(piece.value(s), static_cast<double>(value),
                                1e-5 * (1 + std::abs(static_cast<double>(value))))
                        << what << ", ray " << r;
                }
                return true;
            });
            if (tree != 1 && tree != 4) {
                EXPECT_NEAR(covered, ray.length, 1e-6) << what << ", ray " << r;
            }
            for (bool const skip : {true, false}) {
                scene.skip = skip;
                Counters one, other;
                Radiance const a = iso_ray(all.listed(), scene, ray, one),
                               b = iso_ray(all.unlisted(), scene, ray, other);
                expect_same(a, b, 1e-4, r, what + ", iso");
                met += a.transmittance < 1 ? 1 : 0;
            }
            for (Projected const projection : {Projected::greatest, Projected::least, Projected::mean}) {
                scene.projection = projection;
                Counters one, other;
                expect_same(project_ray(all.listed(), scene, ray, one), project_ray(all.unlisted(), scene, ray, other),
                            2e-6, r, what + ", projected");
            }
        });
        ++tree;
    }
    EXPECT_GT(met, 500);
}

TEST(RenderUnlisted, ExactLightIsTheSame) {
    int tree = 0;
    for (Volume const& volume : trees()) {
        Scene all(volume, false);
        for_some_rays(all, 200, [&](Ray const& ray, int r) {
            Counters one, other;
            expect_same(exact_ray(all.listed(), all.scene, ray, one), exact_ray(all.unlisted(), all.scene, ray, other),
                        1e-6, r, text("tree ", tree));
        });
        ++tree;
    }
}

} // namespace
