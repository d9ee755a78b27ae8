// Marching through the blocks of hierarchical volumes: what they hold, and pictures beside those by bricks.
// SPDX-License-Identifier: MIT
#include "render_trees.h"

#include "libvkt/core/text.h"
#include "libvkt/render/inner/block_march.h"

#include <random>

using namespace vkt;
using namespace vkt::render;
using namespace vkt::render::testing;

namespace {

struct Blocks {
    Tree tree;
    TransferTable table{{{0, 0, 1, 1, 1}, {1, 1, 1, 1, 1}}};
    Tree::Visibility bricks = tree.classify(table);
    CellVisibility cells = classify_cells(tree.cells().grid, table);
    StoredBlocks stored;
    TreeView view;

    Blocks(Volume const& volume, bool all)
        : tree(volume, true, amr_test::execution()), stored(tree.blocks(cells, table, all, std::size_t{1} << 30, 2)),
          view(tree.view(bricks, stored)) {}
    float at(Double3 p) const {
        double const place[3] = {p.x, p.y, p.z};
        BlockLeaf const& leaf = view.blocks.at(place);
        float q[3];
        for (int a = 0; a < 3; ++a)
            q[a] = static_cast<float>(std::ldexp(place[a] - leaf.lower[a], view.blocks.thin[a] ? 0 : -leaf.level) +
                                      block_halo - 0.5);
        auto const* const cells_of_leaf =
            static_cast<float const*>(view.blocks.cells) + std::int64_t{block_size} * leaf.block;
        return BlockPoints<float>::sampler(cells_of_leaf).value({q[0], q[1], q[2]});
    }
};

/// Levels of the bricks that reach a leaf.
int levels_at(Volume const& volume, BlockLeaf const& leaf) {
    std::vector<int> levels;
    Vec3 lower, upper;
    for (int a = 0; a < 3; ++a) lower[a] = leaf.lower[a], upper[a] = leaf.lower[a] + leaf.edge;
    for (Brick const& brick : volume.bricks())
        if (domain_meets(brick, volume.header().dims, lower, upper)) levels.push_back(brick.level);
    std::sort(levels.begin(), levels.end());
    levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
    return static_cast<int>(levels.size());
}

double width_of(Volume const& volume, BlockLeaf const& leaf, int axis) {
    return static_cast<double>(cell_width(volume.header().dims, leaf.level)[axis]);
}

TEST(RenderBlocks, HoldTheReconstructionWhereOneLevelReaches) {
    for (Volume const& volume :
         {small_tree(), cut<float>(blobs({20, 28, 24}, DataType::float32), {8, 8, 8}), sphere_tree()}) {
        Blocks const blocks(volume, true);
        ASSERT_FALSE(blocks.stored.cells.empty());
        TreeSampler const sampler(volume);
        Index3 const dims = volume.header().dims;
        std::mt19937 random(5);
        std::uniform_real_distribution<> share(0, 1);
        int pure = 0, mixed = 0;
        double const range = united(brick_ranges(volume, amr_test::execution())).maximum;
        for (int i = 0; i < 3000; ++i) {
            Double3 const p{share(random) * static_cast<double>(dims.x), share(random) * static_cast<double>(dims.y),
                            share(random) * static_cast<double>(dims.z)};
            double const place[3] = {p.x, p.y, p.z};
            BlockLeaf const& leaf = blocks.view.blocks.at(place);
            ASSERT_GE(leaf.block, 0);
            float const expected = sampler.sample({p.x, p.y, p.z}).value;
            if (levels_at(volume, leaf) == 1) {
                ++pure;
                EXPECT_NEAR(blocks.at(p), expected, 1e-6 * range)
                    << p.x << " " << p.y << " " << p.z << " " << leaf.lower[0] << " " << leaf.edge;
                continue;
            }
            ++mixed;
            Double3 centre = p; // of a cell
            auto const middle = [&](double at, int a) {
                double const w = width_of(volume, leaf, a);
                return leaf.lower[a] + (std::floor((at - leaf.lower[a]) / w) + 0.5) * w;
            };
            centre = {middle(p.x, 0), middle(p.y, 1), middle(p.z, 2)};
            EXPECT_NEAR(blocks.at(centre), sampler.sample({centre.x, centre.y, centre.z}).value, 1e-6 * range);
        }
        EXPECT_GT(pure, 300);
        EXPECT_EQ(mixed > 300, volume.header().level_count > 1);
    }
}

} // namespace
