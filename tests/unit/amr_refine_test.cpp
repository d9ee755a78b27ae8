// Refinement by tolerance: the promise holds at every voxel, and bricks go where they are needed.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/amr/refine.h"

#include <array>
#include <map>

using namespace amr_test;

namespace {

Volume grid_of(Index3 dims, DataType type, std::function<double(Vec3)> const& field) {
    Header header;
    header.dims = dims;
    header.dtype = type;
    Volume volume(header);
    std::byte* const data = volume.buffer().write(Space::host);
    std::int64_t i = 0;
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x, ++i) {
                double const v = field({static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)});
                if (type == DataType::float32)
                    reinterpret_cast<float*>(data)[i] = static_cast<float>(v);
                else
                    reinterpret_cast<std::uint8_t*>(data)[i] = static_cast<std::uint8_t>(v);
            }
    return volume;
}

double blob(Vec3 p) {
    double const r = (p.x - 40) * (p.x - 40) + (p.y - 30) * (p.y - 30) + (p.z - 20) * (p.z - 20);
    return 200 * std::exp(-r / 60);
}

double worst_error(Volume const& volume, Volume const& tree, Reconstruction method, double background) {
    Volume const back = reconstruct(tree, plan_grid(tree.header(), {}), method, background, execution());
    EXPECT_EQ(back.header().dims, volume.header().dims);
    double worst = 0;
    for (std::int64_t i = 0; i < volume.header().voxels(); ++i) {
        bool const real = volume.header().dtype == DataType::float32;
        double const a = real ? static_cast<double>(cells_of<float>(volume)[i]) : cells_of<std::uint8_t>(volume)[i];
        double const b = real ? static_cast<double>(cells_of<float>(back)[i]) : cells_of<std::uint8_t>(back)[i];
        worst = std::max(worst, std::abs(a - b));
    }
    return worst;
}

/// Value of each cell by level and first finest cell.
std::map<std::array<std::int64_t, 4>, float> cells_by_place(Volume const& tree) {
    std::map<std::array<std::int64_t, 4>, float> cells;
    float const* cell = cells_of<float>(tree);
    for (Brick const& brick : tree.bricks()) {
        Index3 const w = cell_width(tree.header().dims, brick.level);
        for (std::int64_t z = 0; z < brick.dims.z; ++z)
            for (std::int64_t y = 0; y < brick.dims.y; ++y)
                for (std::int64_t x = 0; x < brick.dims.x; ++x)
                    cells[{brick.level, brick.lower.x + x * w.x, brick.lower.y + y * w.y, brick.lower.z + z * w.z}] =
                        *cell++;
    }
    return cells;
}

TEST(AmrRefine, MixedBricksHoldTheSameCells) {
    for (Index3 const dims : {Index3{67, 38, 29}, Index3{32, 32, 32}, Index3{67, 41, 1}, Index3{1, 100, 1},
                              Index3{5, 3, 2}, Index3{1, 1, 1}})
        for (double const tolerance : {0.0, 2.0, 1000.0})
            for (bool const sparse : {false, true}) {
                Volume const volume = grid_of(dims, DataType::float32, blob);
                RefineOptions options;
                options.tolerance = tolerance;
                options.block = 2;
                if (sparse) options.background = 0;
                Volume const apart = refine(volume, options, execution());
                options.largest = 16;
                Volume const mixed = refine(volume, options, execution());
                validate_tree(dims, mixed.bricks(), sparse ? Coverage::may_have_holes : Coverage::complete);
                EXPECT_EQ(cells_by_place(mixed), cells_by_place(apart));
                EXPECT_LE(mixed.bricks().size(), apart.bricks().size());
                std::int64_t largest = 0;
                for (Brick const& brick : mixed.bricks())
                    largest = std::max({largest, brick.dims.x, brick.dims.y, brick.dims.z});
                EXPECT_LE(largest, 16);
                // All of one level: as large as bricks may be.
                if (dims == Index3{32, 32, 32} && tolerance == 0 && !sparse) {
                    EXPECT_EQ(largest, 16);
                }
                EXPECT_FALSE(mixed.bricks().words().empty());
            }
}

TEST(AmrRefine, KeepsItsPromiseWithFewerCells) {
    for (DataType const type : {DataType::float32, DataType::uint8}) {
        Volume const volume = grid_of({131, 70, 53}, type, blob);
        std::int64_t previous = volume.header().voxels() + 1;
        for (double const tolerance : {0.0, 1.0, 8.0})
            for (Reconstruction const method : {Reconstruction::basis, Reconstruction::nearest}) {
                RefineOptions options;
                options.tolerance = tolerance;
                options.method = method;
                Volume const tree = refine(volume, options, execution());
                validate_tree(tree.header().dims, tree.bricks(), Coverage::complete);
                EXPECT_LE(worst_error(volume, tree, method, 0), tolerance + 1e-9);
                if (method != Reconstruction::basis) continue;
                EXPECT_LE(tree.header().cell_count, previous);
                previous = tree.header().cell_count;
            }
        EXPECT_LT(previous, volume.header().voxels() * 2 / 5); // blocks at the three uneven faces stay fine
    }
}

TEST(AmrRefine, BackgroundIsLeftOut) {
    Volume const volume = grid_of({96, 64, 40}, DataType::float32, blob);
    RefineOptions options;
    options.tolerance = 0.5;
    options.background = 0;
    Volume const tree = refine(volume, options, execution());
    validate_tree(tree.header().dims, tree.bricks(), Coverage::may_have_holes);
    EXPECT_GT(summarise(tree.header().dims, tree.bricks()).hole_share(), 0.3);
    EXPECT_LE(worst_error(volume, tree, Reconstruction::basis, 0), 0.5);
    EXPECT_EQ(tree.header().attributes.at("background"), "0");
}

TEST(AmrRefine, NoiseStaysFineAndConstantsBecomeCoarse) {
    std::uint32_t state = 1;
    Volume const noise = grid_of({33, 32, 32}, DataType::float32, [&](Vec3) {
        return static_cast<double>((state = state * 1664525u + 1013904223u) >> 24);
    });
    RefineOptions options;
    options.tolerance = 1;
    EXPECT_EQ(refine(noise, options, execution()).header().cell_count, noise.header().voxels());
    Volume const flat = grid_of({64, 64, 64}, DataType::uint8, [](Vec3) { return 9; });
    options.tolerance = 0;
    EXPECT_EQ(refine(flat, options, execution()).header().cell_count, 512);
    Volume const plane = grid_of({64, 32, 1}, DataType::uint8, [](Vec3) { return 9; });
    EXPECT_EQ(refine(plane, options, execution()).header().cell_count, 2 * 64);
    options.tolerance = -1;
    EXPECT_THROW(refine(flat, options, execution()), Error);
}

} // namespace
