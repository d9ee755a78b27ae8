// Properties that reconstructions must have, each against an independent answer.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/amr/edit.h"
#include "libvkt/amr/sampler.h"
#include "libvkt/operations/voxels/flip.h"

#include <algorithm>
#include <random>

using namespace amr_test;

namespace {

Volume run(Volume const& volume, Index3 dims, Reconstruction method, double background = 0) {
    return reconstruct(volume, whole_grid(volume, dims), method, background, execution());
}

std::vector<Reconstruction> all_methods() {
    return {Reconstruction::basis, Reconstruction::nearest, Reconstruction::average, Reconstruction::automatic};
}

// Test 1.
TEST(AmrReconstruct, ConstantsStayConstant) {
    Volume const volume = make_amr(small_recipe(AmrField::constant), execution());
    for (Reconstruction const method : all_methods())
        for (Index3 const dims : {Index3{37, 29, 31}, Index3{96, 32, 24}, Index3{200, 70, 51}, Index3{5, 3, 2}})
            for (float const v : values_of<float>(run(volume, dims, method)))
                ASSERT_NEAR(v, 1.0f, 2.4e-7f) << enum_name(method);
}

// Test 2.
TEST(AmrReconstruct, NeverLeavesTheRangeOfTheCells) {
    Volume const volume = make_amr(small_recipe(), execution());
    ValueRange const range = united(brick_ranges(volume, execution()));
    for (Reconstruction const method : all_methods())
        for (float const v : values_of<float>(run(volume, {101, 53, 47}, method))) {
            ASSERT_GE(v, range.minimum * (1 - 3e-7));
            ASSERT_LE(v, range.maximum * (1 + 3e-7));
        }
}

// Test 3: by hand, clamped trilinear interpolation in double.
TEST(AmrReconstruct, OneBrickIsClampedTrilinear) {
    Index3 const n{7, 5, 6};
    std::mt19937 random(1);
    Volume const volume =
        make_tree(n, {{{0, 0, 0}, n, 0}}, [&](Vec3) { return std::uniform_real_distribution<>(-1, 1)(random); });
    Index3 const dims{23, 17, 13};
    Volume const result = run(volume, dims, Reconstruction::basis);
    View<float const> const cell = volume.brick_view(0).as<float>(), out = result.view().as<float>();
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x) {
                double expected = 0;
                for (int corner = 0; corner < 8; ++corner) {
                    Index3 const at{x, y, z};
                    Index3 i;
                    double weight = 1;
                    for (int a = 0; a < 3; ++a) {
                        double const q = (static_cast<double>(at[a]) + 0.5) * static_cast<double>(n[a]) /
                                             static_cast<double>(dims[a]) -
                                         0.5;
                        int const bit = corner >> a & 1;
                        weight *= bit != 0 ? q - std::floor(q) : 1 - (q - std::floor(q));
                        i[a] = std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(q)) + bit, 0, n[a] - 1);
                    }
                    expected += weight * static_cast<double>(cell(i.x, i.y, i.z));
                }
                ASSERT_NEAR(out(x, y, z), expected, 5e-7);
            }
}

// Test 4.
TEST(AmrReconstruct, CuttingAGridIntoBricksChangesNothing) {
    Index3 const n{24, 20, 14};
    auto const field = [](Vec3 p) { return std::sin(p.x) + std::cos(2 * p.y) * p.z; };
    Volume const whole = make_tree(n, {{{0, 0, 0}, n, 0}}, field);
    for (std::vector<std::int64_t> const& cuts : {std::vector<std::int64_t>{8, 16}, {4, 8, 12, 16}, {1, 7, 13}}) {
        std::vector<Brick> bricks;
        auto const ranges = [&](std::int64_t extent) {
            std::vector<std::int64_t> edges{0};
            for (std::int64_t const cut : cuts)
                if (cut < extent) edges.push_back(cut);
            edges.push_back(extent);
            return edges;
        };
        auto const xs = ranges(n.x), ys = ranges(n.y), zs = ranges(n.z);
        for (std::size_t k = 0; k + 1 < zs.size(); ++k)
            for (std::size_t j = 0; j + 1 < ys.size(); ++j)
                for (std::size_t i = 0; i + 1 < xs.size(); ++i)
                    bricks.push_back(
                        {{xs[i], ys[j], zs[k]}, {xs[i + 1] - xs[i], ys[j + 1] - ys[j], zs[k + 1] - zs[k]}, 0});
        Volume const cut = make_tree(n, bricks, field);
        validate_tree(n, cut.bricks(), Coverage::complete);
        for (Reconstruction const method : all_methods()) {
            std::vector<float> const a = values_of<float>(run(whole, {61, 33, 29}, method)),
                                     b = values_of<float>(run(cut, {61, 33, 29}, method));
            for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1e-5) << enum_name(method);
        }
    }
}

// Test 5.
TEST(AmrReconstruct, LinearFieldsAreExactInsideALevel) {
    Volume const volume = make_amr(small_recipe(AmrField::linear), execution());
    Index3 const dims{83, 41, 37};
    std::vector<float> const values = values_of<float>(run(volume, dims, Reconstruction::basis));
    SampleGrid const grid = whole_grid(volume, dims);
    int exact = 0;
    double worst = 0, worst_exact = 0;
    double const gradient = 1.0 / 96 + 2.0 / 32 + 3.0 / 24; // per finest cell
    for (std::int64_t k = 0; k < dims.x * dims.y * dims.z; k += 7) {
        Index3 const at{k % dims.x, k / dims.x % dims.y, k / (dims.x * dims.y)};
        Vec3 p;
        for (int a = 0; a < 3; ++a) p[a] = grid.lower[a] + (static_cast<double>(at[a]) + 0.5) * grid.step[a];
        double const error =
            std::abs(values[static_cast<std::size_t>(k)] - amr_field_value(AmrField::linear, volume.header().dims, p));
        worst = std::max(worst, error);
        // Inside a level: all bricks within one cell of the point have the same level, and the domain's face is not
        // near.
        int low = 99, high = -1;
        bool inner = true;
        for (Brick const& brick : volume.bricks()) {
            Vec3 const around{2, 2, 2};
            if (!domain_meets(brick, volume.header().dims, p - around, p + around)) continue;
            low = std::min(low, brick.level);
            high = std::max(high, brick.level);
        }
        auto const margin = static_cast<double>(std::int64_t{1} << high);
        for (int a = 0; a < 3; ++a)
            inner = inner && p[a] > margin && p[a] < static_cast<double>(volume.header().dims[a]) - margin;
        if (low != high || !inner) continue;
        ++exact;
        worst_exact = std::max(worst_exact, error);
    }
    EXPECT_GT(exact, 500);
    EXPECT_LE(worst_exact, 2e-6);
    EXPECT_GT(worst, 0.01);                   // level boundaries are not exact …
    EXPECT_LE(worst, 2 * gradient * 0.5 * 2); // … but bounded: half a fine cell at 2:1, more at the domain's faces
}

// Test 6: the table of the one-dimensional profile, fine cells left of 0, coarse ones right, f(x) = x.
TEST(AmrReconstruct, ProfileAcrossALevelBoundary) {
    Index3 const logical{32, 1, 1};
    Volume const volume =
        make_tree(logical, {{{0, 0, 0}, {16, 1, 1}, 0}, {{16, 0, 0}, {8, 1, 1}, 1}}, [](Vec3 p) { return p.x - 16; });
    TreeSampler const sampler(volume);
    double const table[][3] = {{-1, -1, 1},        {-0.75, -0.55556, 1.125},
                               {-0.5, -0.2, 1.25}, {-0.25, 0, 1.125},
                               {0, 0.25, 1},       {0.25, 0.57143, 0.875},
                               {0.5, 1, 0.75},     {0.75, 1, 0.875},
                               {1, 1, 1},          {1.5, 1.5, 1}};
    for (auto const& row : table) {
        TreeSample const s = sampler.sample({16 + row[0], 0.5, 0.5});
        EXPECT_NEAR(s.value, row[1], 6e-6) << row[0];
        EXPECT_NEAR(s.weight, row[2], 1e-6) << row[0];
        SampleGrid grid;
        grid.lower = {16 + row[0] - 0.125, 0, 0};
        grid.step = {0.25, 1, 1};
        Volume const one = reconstruct(volume, grid, Reconstruction::basis, 0, execution());
        EXPECT_NEAR(values_of<float>(one)[0], row[1], 6e-6) << row[0];
    }
}

// The tile kernels and the point sampler against the definition, on trees with 2:1 and 4:1 neighbours.
TEST(AmrReconstruct, MatchesTheDefinition) {
    std::mt19937 random(3);
    auto const noise = [&](Vec3) { return std::uniform_real_distribution<>(-1, 1)(random); };
    Volume const volume = make_tree({32, 16, 8}, {{{0, 0, 0}, {4, 4, 2}, 2}, {{16, 0, 0}, {16, 16, 8}, 0}}, noise);
    TreeSampler const sampler(volume);
    Index3 const dims{41, 23, 15};
    SampleGrid const grid = whole_grid(volume, dims);
    std::vector<float> const values =
        values_of<float>(reconstruct(volume, grid, Reconstruction::basis, 0, execution()));
    for (std::int64_t k = 0; k < dims.x * dims.y * dims.z; k += 3) {
        Index3 const at{k % dims.x, k / dims.x % dims.y, k / (dims.x * dims.y)};
        Vec3 p;
        for (int a = 0; a < 3; ++a) p[a] = grid.lower[a] + (static_cast<double>(at[a]) + 0.5) * grid.step[a];
        auto const [sum, weight] = brute_force(volume, p);
        ASSERT_NEAR(values[static_cast<std::size_t>(k)], sum / weight, 1e-6);
        TreeSample const s = sampler.sample(p);
        ASSERT_NEAR(s.value, sum / weight, 1e-6);
        ASSERT_NEAR(s.weight, weight, 1e-6);
    }
}

// Test 7: just left and right of every brick's domain faces.
TEST(AmrReconstruct, IsContinuousAcrossBrickFaces) {
    Volume const volume = make_amr(small_recipe(), execution());
    TreeSampler const sampler(volume);
    ValueRange const range = united(brick_ranges(volume, execution()));
    double const span = range.maximum - range.minimum;
    std::mt19937 random(5);
    std::uniform_real_distribution<> unit(0.02, 0.98);
    for (Brick const& brick : volume.bricks()) {
        Box const domain = domain_of(brick, volume.header().dims);
        for (int face = 0; face < 6; ++face) {
            int const a = face / 2;
            Vec3 p;
            for (int b = 0; b < 3; ++b)
                p[b] = std::clamp(
                    0.5 * (static_cast<double>(domain.lower[b]) + unit(random) * static_cast<double>(domain.dims()[b])),
                    0.01, static_cast<double>(volume.header().dims[b]) - 0.01);
            p[a] = 0.5 * static_cast<double>(face % 2 == 0 ? domain.lower[a] : domain.upper[a]);
            if (p[a] <= 0.1 || p[a] >= static_cast<double>(volume.header().dims[a]) - 0.1) continue;
            Vec3 below = p, above = p;
            below[a] -= 1e-4;
            above[a] += 1e-4;
            ASSERT_NEAR(sampler.sample(below).value, sampler.sample(above).value, 1e-3 * span);
        }
    }
}

// Test 8.
TEST(AmrReconstruct, MirroredTreesGiveMirroredGrids) {
    Volume const volume = make_amr(small_recipe(), execution());
    Index3 const dims{50, 31, 27};
    for (int a = 0; a < 3; ++a) {
        Volume const mirrored =
            flip_tree(volume, static_cast<Axis>(a), mirrored_cells(static_cast<Axis>(a)), execution()).whole();
        validate_tree(mirrored.header().dims, mirrored.bricks(), Coverage::complete);
        for (Reconstruction const method : {Reconstruction::basis, Reconstruction::average}) {
            Volume const p = run(volume, dims, method), q = run(mirrored, dims, method);
            View<float const> const straight = p.view().as<float>(), reversed = q.view().as<float>();
            for (std::int64_t z = 0; z < dims.z; ++z)
                for (std::int64_t y = 0; y < dims.y; ++y)
                    for (std::int64_t x = 0; x < dims.x; ++x) {
                        Index3 at{x, y, z};
                        at[a] = dims[a] - 1 - at[a];
                        float const expected = straight(x, y, z);
                        ASSERT_NEAR(reversed(at.x, at.y, at.z), expected, 2e-6f * std::abs(expected));
                    }
        }
        EXPECT_EQ(
            values_of<float>(
                flip_tree(mirrored, static_cast<Axis>(a), mirrored_cells(static_cast<Axis>(a)), execution()).whole()),
            values_of<float>(volume));
    }
}

// Test 8: other names for the axes give the same grid under other names.
TEST(AmrReconstruct, PermutedTreesGivePermutedGrids) {
    Volume const volume = make_amr(small_recipe(), execution());
    Index3 const dims{50, 31, 27};
    for (auto const& axis : permutations()) {
        Volume const turned = permuted(volume, axis);
        validate_tree(turned.header().dims, turned.bricks(), Coverage::complete);
        TreeSampler const one(volume), two(turned);
        for (Reconstruction const method : all_methods()) {
            Volume const p = run(volume, dims, method);
            Volume const q = run(turned, {dims[axis[0]], dims[axis[1]], dims[axis[2]]}, method);
            View<float const> const straight = p.view().as<float>(), other = q.view().as<float>();
            for (std::int64_t z = 0; z < dims.z; ++z)
                for (std::int64_t y = 0; y < dims.y; ++y)
                    for (std::int64_t x = 0; x < dims.x; ++x) {
                        Index3 const at{x, y, z};
                        float const expected = straight(x, y, z);
                        ASSERT_NEAR(other(at[axis[0]], at[axis[1]], at[axis[2]]), expected, 2e-6f * std::abs(expected))
                            << enum_name(method);
                    }
        }
        for (int i = 0; i < 500; ++i) {
            Vec3 const at{0.17 * i, 0.061 * i, 0.047 * i};
            TreeGradientSample const a = one.sample_gradient(at);
            TreeGradientSample const b = two.sample_gradient({at[axis[0]], at[axis[1]], at[axis[2]]});
            ASSERT_NEAR(a.value, b.value, 2e-6f * std::abs(a.value));
            float const steepness = std::abs(a.gradient[0]) + std::abs(a.gradient[1]) + std::abs(a.gradient[2]);
            for (int k = 0; k < 3; ++k)
                ASSERT_NEAR(a.gradient[axis[static_cast<std::size_t>(k)]], b.gradient[k],
                            1e-4f * steepness + 1e-5f * std::abs(a.value));
        }
    }
}

// Test 9, and independence of regions, tiles and threads.
TEST(AmrReconstruct, RegionsThreadsAndCropsGiveTheSameBits) {
    Volume const volume = make_amr(small_recipe(), execution());
    Box const region{{11, 5, 3}, {70, 29, 20}};
    Volume const cropped = crop_tree(volume, region).whole();
    EXPECT_LT(cropped.header().brick_count, volume.header().brick_count);
    GridRequest request;
    request.dims = Index3{131, 47, 35};
    request.roi = {"11:70,5:29,3:20"};
    SampleGrid const grid = plan_grid(volume.header(), request);
    for (Reconstruction const method : all_methods()) {
        Volume const whole = reconstruct(volume, grid, method, 0, execution());
        std::vector<float> const expected = values_of<float>(whole);
        GridRequest same;
        same.dims = request.dims; // the crop's region is the default
        EXPECT_EQ(values_of<float>(reconstruct(cropped, plan_grid(cropped.header(), same), method, 0, execution())),
                  expected);
        EXPECT_EQ(values_of<float>(reconstruct(volume, grid, method, 0, execution(1))), expected);
        Reconstructor const reconstructor(volume, grid, method);
        Volume pieces(reconstructor.header());
        AnyView const all = pieces.mutable_view();
        for (std::int64_t z = 0; z < 35; z += 4)
            for (std::int64_t x = 0; x < 131; x += 50)
                reconstructor.run(
                    all.part({{x, 0, z}, {std::min<std::int64_t>(x + 50, 131), 47, std::min<std::int64_t>(z + 4, 35)}}),
                    execution());
        EXPECT_EQ(values_of<float>(pieces), expected) << enum_name(method);
    }
}

// Test 10.
TEST(AmrReconstruct, OneLevelAtItsOwnGridReturnsTheCells) {
    AmrRecipe recipe = small_recipe();
    recipe.coarsest = recipe.finest;
    recipe.blocks = 0;
    Volume const volume = make_amr(recipe, execution());
    std::vector<float> const cells = values_of<float>(run(volume, volume.header().dims, Reconstruction::nearest));
    EXPECT_EQ(values_of<float>(run(volume, volume.header().dims, Reconstruction::basis)), cells);
    EXPECT_EQ(values_of<float>(run(volume, volume.header().dims, Reconstruction::average)), cells);
    double sum = 0, expected = 0;
    for (float const v : cells) sum += static_cast<double>(v);
    float const* const stored = cells_of<float>(volume);
    for (std::size_t i = 0; i < cells.size(); ++i) expected += static_cast<double>(stored[i]);
    EXPECT_NEAR(sum, expected, 1e-9 * expected);
}

TEST(AmrReconstruct, NotANumberStaysWhereItIs) {
    Index3 const n{9, 8, 7};
    Volume volume = make_tree(n, {{{0, 0, 0}, n, 0}}, [](Vec3 p) { return p.x; });
    volume.mutable_brick_view(0).as<float>()(4, 4, 4) = std::nanf("");
    volume.mutable_brick_view(0).as<float>()(1, 1, 1) = std::numeric_limits<float>::infinity();
    Volume const result = run(volume, n, Reconstruction::basis);
    int nan = 0, infinite = 0;
    for (float const v : values_of<float>(result)) {
        nan += std::isnan(v) ? 1 : 0;
        infinite += std::isinf(v) ? 1 : 0;
    }
    EXPECT_EQ(nan, 1);
    EXPECT_EQ(infinite, 1);
}

// Test 11.
TEST(AmrReconstruct, BrickOrderOnlyRounds) {
    Volume const volume = make_amr(small_recipe(), execution());
    std::vector<std::size_t> order(volume.bricks().size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), std::mt19937(7));
    std::vector<Brick> bricks;
    for (std::size_t const i : order) bricks.push_back(volume.bricks()[i]);
    Volume shuffled(volume.header(), bricks);
    for (std::size_t i = 0; i < order.size(); ++i) copy(volume.brick_view(order[i]), shuffled.mutable_brick_view(i));
    for (Reconstruction const method : all_methods()) {
        std::vector<float> const a = values_of<float>(run(volume, {77, 41, 33}, method)),
                                 b = values_of<float>(run(shuffled, {77, 41, 33}, method));
        for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1e-6 * std::abs(a[i]));
    }
}

// Test 13: the integral survives any grid; and averages of a refinable grid are averages of averages.
TEST(AmrReconstruct, AverageConservesTheIntegral) {
    Volume const volume = make_amr(small_recipe(), execution());
    double expected = 0;
    float const* cell = cells_of<float>(volume);
    for (Brick const& brick : volume.bricks())
        for (std::int64_t i = 0; i < brick.cells(); ++i)
            expected += static_cast<double>(*cell++) * std::pow(8.0, brick.level);
    for (Index3 const dims : {Index3{1, 1, 1}, Index3{7, 5, 3}, Index3{96, 32, 24}, Index3{130, 61, 40}}) {
        SampleGrid const grid = whole_grid(volume, dims);
        double sum = 0;
        for (float const v : values_of<float>(reconstruct(volume, grid, Reconstruction::average, 0, execution())))
            sum += static_cast<double>(v);
        EXPECT_NEAR(sum * grid.step.x * grid.step.y * grid.step.z, expected, 1e-6 * expected);
    }
}

TEST(AmrReconstruct, AutomaticAveragesOnlyWhereVoxelsCoverSeveralCells) {
    // Left half on level 2, right half on level 0; voxels of 2 finest cells.
    Volume const volume = make_tree({64, 16, 8}, {{{0, 0, 0}, {8, 4, 2}, 2}, {{32, 0, 0}, {32, 16, 8}, 0}},
                                    [](Vec3 p) { return p.x * p.x + p.y; });
    Index3 const dims{32, 8, 4};
    Volume const automatic = run(volume, dims, Reconstruction::automatic),
                 basis = run(volume, dims, Reconstruction::basis), average = run(volume, dims, Reconstruction::average);
    for (std::int64_t x = 0; x < 32; ++x) {
        float const v = automatic.view().as<float>()(x, 3, 2);
        EXPECT_EQ(v, (x < 16 ? basis : average).view().as<float>()(x, 3, 2)) << x;
    }
}

// Test 21.
TEST(AmrReconstruct, HolesBecomeBackgroundAndMask) {
    Volume const volume =
        make_tree({32, 16, 8}, {{{0, 0, 0}, {8, 8, 8}, 0}, {{16, 8, 0}, {4, 4, 4}, 1}}, [](Vec3) { return 5; });
    EXPECT_THROW(validate_tree(volume.header().dims, volume.bricks(), Coverage::complete), Error);
    validate_tree(volume.header().dims, volume.bricks(), Coverage::may_have_holes);
    EXPECT_DOUBLE_EQ(summarise(volume.header().dims, volume.bricks()).hole_share(), 1 - 1024.0 / 4096);
    // Means over voxels that are half full: the background is the other half, unless it is no number.
    Volume const half = make_tree({8, 8, 8}, {{{0, 0, 0}, {4, 8, 8}, 0}}, [](Vec3) { return 3; });
    for (Reconstruction const method : {Reconstruction::average, Reconstruction::automatic}) {
        EXPECT_EQ(values_of<float>(run(half, {1, 2, 2}, method, -7)), std::vector<float>(4, -2));
        EXPECT_EQ(values_of<float>(run(half, {1, 2, 2}, method, std::nan(""))), std::vector<float>(4, 3));
    }
    for (Reconstruction const method : all_methods()) {
        Volume mask;
        Volume const grid = reconstruct(volume, whole_grid(volume, {32, 16, 8}), method, -7, execution(), &mask);
        std::int64_t covered = 0;
        std::vector<float> const values = values_of<float>(grid);
        std::vector<std::uint8_t> const flags = values_of<std::uint8_t>(mask);
        for (std::size_t i = 0; i < values.size(); ++i) {
            ASSERT_EQ(values[i], flags[i] == 1 ? 5.0f : -7.0f);
            covered += flags[i];
        }
        // All cover the bricks; basis reaches half a coarse cell further.
        if (method == Reconstruction::basis)
            EXPECT_GT(covered, 1024);
        else
            EXPECT_EQ(covered, 1024);
    }
}

// Voxels larger than cells, as large, smaller, and in no whole ratio to them.
TEST(AmrReconstruct, AutomaticKeepsTheIntegralWhereThereAreHoles) {
    std::mt19937 random(7);
    Volume const volume =
        make_tree({32, 16, 8}, {{{0, 0, 0}, {8, 8, 8}, 0}, {{8, 4, 0}, {2, 3, 2}, 2}, {{24, 8, 0}, {4, 4, 4}, 1}},
                  [&](Vec3) { return std::uniform_real_distribution<>(1, 2)(random); });
    double cells = 0, covered = 0;
    float const* cell = cells_of<float>(volume);
    for (Brick const& brick : volume.bricks())
        for (std::int64_t i = 0; i < brick.cells(); ++i) {
            cells += static_cast<double>(*cell++) * std::pow(8.0, brick.level);
            covered += std::pow(8.0, brick.level);
        }
    for (double const background : {0.0, -3.0})
        for (Index3 const dims : {Index3{1, 1, 1}, Index3{13, 5, 3}, Index3{25, 13, 6}, Index3{32, 16, 8},
                                  Index3{41, 23, 11}, Index3{64, 32, 16}, Index3{128, 64, 32}}) {
            SampleGrid const grid = whole_grid(volume, dims);
            double sum = 0;
            for (float const v : values_of<float>(run(volume, dims, Reconstruction::automatic, background)))
                sum += static_cast<double>(v);
            double const want = cells + background * (4096 - covered);
            EXPECT_NEAR(sum * grid.step.x * grid.step.y * grid.step.z, want, 1e-6 * cells) << dims.x;
        }
}

// Holes elsewhere, outside the grid or outside the logical grid, change nothing.
TEST(AmrReconstruct, AutomaticLooksForHolesInsideTheGrid) {
    auto const field = [](Vec3 p) { return p.x * p.x + p.y * p.z; };
    Volume const whole = make_tree({32, 16, 8}, {{{0, 0, 0}, {8, 16, 8}, 0}, {{8, 0, 0}, {4, 8, 4}, 1}}, field);
    auto const values = [&](SampleGrid const& grid, Reconstruction method) {
        return values_of<float>(reconstruct(whole, grid, method, 0, execution()));
    };
    SampleGrid grid{{0.3, -5, -1}, {0.7, 0.9, 0.5}, {22, 30, 20}}; // up to 15.7 of 16, and beyond 0 and 16 along y
    EXPECT_FALSE(leaves_holes(whole.header(), whole.bricks(), grid));
    EXPECT_EQ(values(grid, Reconstruction::automatic), values(grid, Reconstruction::basis));
    grid.dims.x = 23; // up to 16.4
    EXPECT_TRUE(leaves_holes(whole.header(), whole.bricks(), grid));
    EXPECT_EQ(values(grid, Reconstruction::automatic), values(grid, Reconstruction::average));
    // A face that rounding put beyond the last cell is no look beyond it.
    grid = {{0, 0, 0}, {16.0 / 49 * (1 + 1e-12), 1, 1}, {49, 16, 8}};
    EXPECT_FALSE(leaves_holes(whole.header(), whole.bricks(), grid));
    // More cells than 64 bits count: a hole of one brick is none of rounding.
    std::int64_t const wide = std::int64_t{1} << 40;
    std::vector<Brick> bricks;
    for (std::int64_t i = 0; i < 8; ++i)
        bricks.push_back({{(i & 1) * wide / 2, (i >> 1 & 1) * wide / 2, (i >> 2) * wide / 2}, {1, 1, 1}, 39});
    Header header;
    header.dims = {wide, wide, wide};
    auto const step = static_cast<double>(wide);
    EXPECT_FALSE(leaves_holes(header, bricks, {{}, {step, step, step}, {1, 1, 1}}));
    bricks.pop_back();
    EXPECT_TRUE(leaves_holes(header, bricks, {{}, {step, step, step}, {1, 1, 1}}));
}

// Test 22.
TEST(AmrReconstruct, FarAwayIsAsPreciseAsNear) {
    std::mt19937 random(11);
    std::vector<Brick> near{{{0, 0, 0}, {8, 8, 8}, 1}, {{0, 0, 16}, {16, 16, 8}, 0}}, far = near;
    for (Brick& brick : far) brick.lower.z += 81000;
    Volume const a =
        make_tree({16, 16, 81920}, near, [&](Vec3) { return std::uniform_real_distribution<>(0, 1)(random); });
    random.seed(11);
    Volume const b =
        make_tree({16, 16, 81920}, far, [&](Vec3) { return std::uniform_real_distribution<>(0, 1)(random); });
    SampleGrid grid;
    grid.dims = {37, 29, 41};
    grid.step = {16.0 / 37, 16.0 / 29, 24.0 / 41};
    SampleGrid shifted = grid;
    shifted.lower.z = 81000;
    for (Reconstruction const method : all_methods()) {
        std::vector<float> const p = values_of<float>(reconstruct(a, grid, method, 0, execution())),
                                 q = values_of<float>(reconstruct(b, shifted, method, 0, execution()));
        for (std::size_t i = 0; i < p.size(); ++i) ASSERT_NEAR(p[i], q[i], 2e-7) << enum_name(method);
    }
}

TEST(AmrReconstruct, GradientsCarryEveryBricksOwnWidth) {
    // Inside coarse and fine regions alike the gradient of the linear field, per finest cell.
    Volume const volume = make_tree({64, 16, 16}, {{{0, 0, 0}, {8, 4, 4}, 2}, {{32, 0, 0}, {32, 16, 16}, 0}},
                                    [](Vec3 p) { return p.x + 2 * p.y - 3 * p.z; });
    TreeSampler const sampler(volume);
    for (Vec3 const p : {Vec3{10.3, 7.1, 8.2}, Vec3{50.2, 7.7, 9.1}}) {
        TreeGradientSample const s = sampler.sample_gradient(p);
        EXPECT_NEAR(s.gradient[0], 1, 2e-5);
        EXPECT_NEAR(s.gradient[1], 2, 2e-5);
        EXPECT_NEAR(s.gradient[2], -3, 2e-5);
    }
    // At the boundary: the analytic gradient is the limit of differences.
    for (double const x : {31.2, 31.7, 32.2, 32.4, 33.1}) {
        double const h = 1e-3;
        TreeGradientSample const s = sampler.sample_gradient({x, 7.3, 8.1});
        double const difference = (static_cast<double>(sampler.sample({x + h, 7.3, 8.1}).value) -
                                   static_cast<double>(sampler.sample({x - h, 7.3, 8.1}).value)) /
                                  (2 * h);
        EXPECT_NEAR(s.gradient[0], difference, 0.02) << x;
    }
    EXPECT_EQ(sampler.sample({-5, 3, 3}).weight, 0);
}

TEST(AmrReconstruct, EveryTypeKeepsItsValues) {
    for (DataType const type :
         {DataType::uint8, DataType::int8, DataType::uint16, DataType::int16, DataType::uint32, DataType::int32,
          DataType::uint64, DataType::int64, DataType::float16, DataType::float32, DataType::float64}) {
        Header header;
        header.dims = {20, 12, 10};
        header.dtype = type;
        Volume volume(header, {{{0, 0, 0}, {20, 12, 10}, 0}});
        auto* const bytes = reinterpret_cast<std::uint8_t*>(volume.buffer().write(Space::host));
        for (std::size_t i = 0; i < header.bytes(); ++i) bytes[i] = 0;
        for (std::size_t i = 0; i < volume.header().bytes(); ++i)
            bytes[i] = static_cast<std::uint8_t>(i % 2 == 0 ? 17 + i % 23 : 60);
        for (Reconstruction const method : all_methods()) {
            Volume const same = run(volume, header.dims, method);
            // 64-bit integers beyond 2^53 go through double; all other values come back as they are.
            if (size_of(type) == 8 && type != DataType::float64 && method != Reconstruction::nearest) continue;
            EXPECT_EQ(std::memcmp(same.buffer().read(Space::host), bytes, volume.header().bytes()), 0)
                << name_of(type) << enum_name(method);
        }
    }
}

TEST(AmrReconstruct, InstructionSetsAgree) {
    Volume const volume = make_amr(small_recipe(), execution());
    SampleGrid const grid = whole_grid(volume, {97, 41, 35});
    Execution other = execution();
    other.instructions = InstructionSet::baseline;
    for (Reconstruction const method : all_methods()) {
        std::vector<float> const a = values_of<float>(reconstruct(volume, grid, method, 0, execution())),
                                 b = values_of<float>(reconstruct(volume, grid, method, 0, other));
        for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1e-6 * std::abs(a[i]));
    }
}

TEST(AmrReconstruct, GridsFollowTheRequest) {
    Volume const volume = make_amr(small_recipe(), execution());
    GridRequest request;
    request.cells = 20000;
    SampleGrid const grid = plan_grid(volume.header(), request);
    EXPECT_NEAR(static_cast<double>(grid.dims.x * grid.dims.y * grid.dims.z), 20000, 2000);
    EXPECT_NEAR(grid.step.x, grid.step.y, 0.1 * grid.step.x);
    request.dims = Index3{1, 2, 3};
    EXPECT_THROW(plan_grid(volume.header(), request), Error);
    request.cells.reset();
    request.dims = Index3{48, 16, 12};
    Header const header = gridded_header(volume.header(), plan_grid(volume.header(), request));
    EXPECT_EQ(header.kind, Kind::structured);
    EXPECT_DOUBLE_EQ(header.geometry.spacing.x, 2);
    EXPECT_DOUBLE_EQ(header.geometry.origin.x, 0.5);
    request.roi = {"0:200,0:1,0:1"};
    EXPECT_THROW(plan_grid(volume.header(), request), Error);
}

} // namespace
