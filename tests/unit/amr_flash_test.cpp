// FLASH files written by the library and read back: grids from float32 boxes, versions, guards, parents, regions,
// damage.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/amr/edit.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/flash.h"

#include <algorithm>
#include <random>

using namespace amr_test;

namespace {

void expect_same(Volume const& a, Volume const& b) {
    EXPECT_EQ(to_text(a.header().dims), to_text(b.header().dims));
    EXPECT_TRUE(a.bricks() == b.bricks());
    EXPECT_EQ(a.header().dtype, b.header().dtype);
    ASSERT_EQ(a.header().bytes(), b.header().bytes());
    EXPECT_EQ(std::memcmp(a.buffer().read(Space::host), b.buffer().read(Space::host), a.header().bytes()), 0);
}

// Test 18 at SILCC's size: 4096 x 4096 x 81920 out of float32 boxes, in a domain that is not centred and in
// centimetres.
TEST(AmrFlashFile, FindsTheLogicalGridOfASilccLikeFile) {
    if (!built_with_hdf5()) GTEST_SKIP() << "built without HDF5";
    AmrRecipe recipe = silcc_like();
    recipe.block = {2, 2, 8};
    Volume const volume = make_amr(recipe, execution());
    EXPECT_EQ(volume.header().level_count, 7);
    TemporaryFile const file("silcc");
    FlashWriteOptions options;
    options.domain_lower = {-7.715e20, -7.715e20, -1.6e22};
    options.domain_upper = {7.715e20, 7.715e20, -1.6e22 + 20 * 1.543e21};
    write_flash(volume, file.path(), "dens", options);
    Volume const back = read_flash(file.path(), {}, execution());
    EXPECT_EQ(back.header().dims, (Index3{1024, 1024, 81920}));
    expect_same(back, volume);
    EXPECT_NEAR(back.header().geometry.spacing.z * 81920 / (20 * 1.543e21), 1, 1e-12);
}

TEST(AmrFlashFile, SilccLikeRecipeHasItsSize) {
    AmrRecipe const recipe = silcc_like();
    EXPECT_EQ(recipe.roots, (Index3{1, 1, 20}));
    Volume const small = [&] {
        AmrRecipe fewer = recipe;
        fewer.block = {2, 2, 2}; // the same tree, less data
        return make_amr(fewer, execution());
    }();
    EXPECT_EQ(small.header().brick_count, 142190); // leaves come in steps of seven
    EXPECT_EQ(summarise(small.header().dims, small.bricks()).levels.size(), 7u);
    validate_tree(small.header().dims, small.bricks(), Coverage::complete);
}

// Cells of cylinders and spheres are not the boxes that everything here takes them for.
TEST(AmrFlashFile, RefusesGeometriesOtherThanCartesian) {
    if (!built_with_hdf5()) GTEST_SKIP() << "built without HDF5";
    Volume const volume = make_amr(small_recipe(), execution());
    TemporaryFile const file("geometry");
    FlashWriteOptions options;
    options.for_others = true;
    write_flash(volume, file.path(), "dens", options);
    EXPECT_EQ(read_flash(file.path(), {}, execution()).header().dims, volume.header().dims);
    for (char const* const geometry : {"cylindrical", "spherical", "polar"}) {
        options.geometry = geometry;
        write_flash(volume, file.path(), "dens", options);
        try {
            list_flash(file.path());
            FAIL() << geometry;
        } catch (Error const& error) {
            EXPECT_EQ(error.kind(), ErrorKind::data);
            EXPECT_NE(std::string(error.what()).find(geometry), std::string::npos) << error.what();
        }
    }
}

// Versions, guard cells, both precisions; tests 15 (parents hold NaN) and 17.
TEST(AmrFlashFile, ReadsBackEveryLayout) {
    if (!built_with_hdf5()) GTEST_SKIP() << "built without HDF5";
    for (DataType const type : {DataType::float32, DataType::float64})
        for (int const version : {7, 8, 9})
            for (int const guards : {0, 4})
                for (bool const parents : {true, false}) {
                    AmrRecipe recipe = small_recipe();
                    recipe.dtype = type;
                    Volume const volume = make_amr(recipe, execution());
                    TemporaryFile const file("layout");
                    FlashWriteOptions options;
                    options.version = version;
                    options.guard_cells = guards;
                    options.parents = parents;
                    options.single_boxes = type == DataType::float32;
                    options.domain_upper = {3, 2, 1};
                    write_flash(volume, file.path(), "dens", options);
                    AmrListing const listing = list_flash(file.path());
                    EXPECT_EQ(listing.format, text("FLASH ", version));
                    EXPECT_EQ(listing.blocks_in_file > listing.header.brick_count, parents);
                    expect_same(read_flash(file.path(), {}, execution()), volume);
                }
}

TEST(AmrFlashFile, OneAndTwoDimensionsOnSeveralLevels) {
    if (!built_with_hdf5()) GTEST_SKIP() << "built without HDF5";
    for (int const dimensions : {1, 2}) {
        AmrRecipe recipe;
        recipe.roots = {3, dimensions == 2 ? 2 : 1, 1};
        recipe.block = {8, dimensions == 2 ? 4 : 1, 1};
        recipe.finest = 3;
        recipe.blocks = dimensions == 2 ? 40 : 8;
        Volume const volume = make_amr(recipe, execution());
        EXPECT_GT(volume.header().level_count, 1);
        EXPECT_EQ(volume.header().dims.z, 1);
        TemporaryFile const file("flat");
        for (int const version : {8, 9}) {
            FlashWriteOptions options;
            options.version = version;
            options.domain_upper = {3, 2, 1};
            write_flash(volume, file.path(), "dens", options);
            EXPECT_EQ(list_flash(file.path()).dimensions, dimensions);
            expect_same(read_flash(file.path(), {}, execution()), volume);
        }
    }
}

// Test 9 for files: reading a region equals cropping, and resamples to the same bits.
TEST(AmrFlashFile, RegionsReadOnlyTheBlocksThatMatter) {
    if (!built_with_hdf5()) GTEST_SKIP() << "built without HDF5";
    Volume const volume = make_amr(small_recipe(), execution());
    TemporaryFile const file("region");
    write_flash(volume, file.path(), "dens", {});
    AmrReadOptions options;
    options.roi = {"30:50,4:20,2:9"};
    Volume const part = read_flash(file.path(), options, execution());
    Volume const cropped = crop_tree(volume, {{30, 4, 2}, {50, 20, 9}}).whole();
    EXPECT_LT(part.header().brick_count, volume.header().brick_count);
    expect_same(part, cropped);
    GridRequest request;
    request.dims = Index3{40, 33, 21};
    Volume const a = reconstruct(part, plan_grid(part.header(), request), Reconstruction::basis, 0, execution());
    request.roi = options.roi;
    Volume const b = reconstruct(volume, plan_grid(volume.header(), request), Reconstruction::basis, 0, execution());
    EXPECT_EQ(values_of<float>(a), values_of<float>(b));
}

// Test 20: a leaf is missing.
TEST(AmrFlashFile, RefusesATreeThatDoesNotCoverItsDomain) {
    if (!built_with_hdf5()) GTEST_SKIP() << "built without HDF5";
    Volume const volume = make_amr(small_recipe(), execution());
    std::vector<Brick> bricks = volume.bricks().list();
    bricks.erase(bricks.begin() + 17);
    Volume const broken(volume.header(), bricks);
    std::memset(broken.buffer().write(Space::host), 0, broken.header().bytes());
    TemporaryFile const file("hole");
    write_flash(broken, file.path(), "dens", {});
    try {
        read_flash(file.path(), {}, execution());
        FAIL() << "a tree with a hole was read";
    } catch (Error const& error) {
        EXPECT_EQ(error.kind(), ErrorKind::data);
        EXPECT_NE(std::string(error.what()).find("cover"), std::string::npos);
    }
}

// Cubes of mixed sizes, cut off where the grid ends: none of a partition, moved or enlarged, is taken twice.
TEST(AmrFlashFile, MixedCubesOverlapOrDoNot) {
    Index3 const logical{27, 16, 33};
    std::mt19937 random(3);
    std::vector<Brick> bricks;
    auto const divide = [&](auto const& self, Index3 lower, std::int64_t edge) -> void {
        Brick brick{lower, {}, 0};
        for (int a = 0; a < 3; ++a) {
            if (lower[a] >= logical[a]) return;
            brick.dims[a] = std::min(edge, logical[a] - lower[a]);
        }
        if (edge > 1 && (edge > 16 || random() % 2 != 0)) {
            for (int i = 0; i < 8; ++i)
                self(self, lower + Index3{(i & 1) * edge / 2, (i >> 1 & 1) * edge / 2, (i >> 2) * edge / 2}, edge / 2);
            return;
        }
        if (bool const whole = brick.dims.x == edge && brick.dims.y == edge && brick.dims.z == edge; whole && edge >= 4)
            for (brick.level = static_cast<int>(random() % 2); int const a : {0, 1, 2}) brick.dims[a] >>= brick.level;
        bricks.push_back(brick);
    };
    divide(divide, {0, 0, 0}, 64);
    std::shuffle(bricks.begin(), bricks.end(), random);
    validate_tree(logical, bricks, Coverage::complete);
    for (int n = 0; n < 60; ++n) {
        std::vector<Brick> changed = bricks;
        Brick& brick = changed[random() % changed.size()];
        int const axis = static_cast<int>(random() % 3);
        if (n % 2 == 0)
            brick.lower[axis] += random() % 2 == 0 ? 2 : -2; // the lattice of level 1 is kept
        else
            brick.dims[axis] *= 2;
        Box const box = bounds_of(brick, logical);
        bool overlaps = false;
        for (Brick const& other : changed)
            overlaps = overlaps || (&other != &brick && !intersect(box, bounds_of(other, logical)).empty());
        bool const leaves = !box_of(logical).contains(box);
        if (overlaps || leaves)
            EXPECT_THROW(validate_tree(logical, changed, Coverage::may_have_holes), Error) << n;
        else
            validate_tree(logical, changed, Coverage::may_have_holes);
    }
}

TEST(AmrFlashFile, TwistedTreesAreRefused) {
    std::vector<Brick> bricks{{{0, 0, 0}, {8, 8, 8}, 0}, {{8, 0, 0}, {8, 8, 8}, 0}};
    Index3 const logical{16, 8, 8};
    validate_tree(logical, bricks, Coverage::complete);
    bricks[1].lower.x = 4;
    EXPECT_THROW(validate_tree(logical, bricks, Coverage::may_have_holes), Error); // overlap
    bricks[1].lower.x = 12;
    EXPECT_THROW(validate_tree(logical, bricks, Coverage::may_have_holes), Error); // leaves the grid
    bricks[1] = {{8, 0, 0}, {4, 4, 4}, 63};
    EXPECT_THROW(validate_tree(logical, bricks, Coverage::may_have_holes), Error); // no such level
    bricks[1] = {{8, 0, 0}, {std::int64_t{1} << 62, 1, 1}, 2};
    EXPECT_THROW(validate_tree(logical, bricks, Coverage::may_have_holes), Error); // products must not wrap
    EXPECT_THROW(validate_tree({}, bricks, Coverage::may_have_holes), Error);
    EXPECT_THROW(validate_tree(logical, {}, Coverage::may_have_holes), Error);
    // The same through the index: bricks of different sizes.
    bricks = {{{0, 0, 0}, {16, 8, 8}, 0}, {{8, 2, 2}, {2, 2, 2}, 1}};
    EXPECT_THROW(validate_tree(logical, bricks, Coverage::may_have_holes), Error);
}

// Damaged bytes anywhere must end in an error or a volume, never in a crash.
TEST(AmrFlashFile, DamagedFilesAreRefusedOrRead) {
    if (!built_with_hdf5()) GTEST_SKIP() << "built without HDF5";
    AmrRecipe recipe;
    recipe.block = {4, 4, 4};
    recipe.finest = 2;
    recipe.blocks = 8;
    TemporaryFile const file("damaged");
    write_flash(make_amr(recipe, execution()), file.path(), "dens", {});
    std::ifstream in(file.path(), std::ios::binary);
    std::string const good((std::istreambuf_iterator<char>(in)), {});
    std::mt19937 random(2);
    int refused = 0;
    for (int round = 0; round < 150; ++round) {
        std::string bad = good;
        if (round % 3 == 0) bad.resize(random() % bad.size());
        // The tables, not the library's own structures, which it checks by itself or not.
        else
            for (int i = 0; i < 4; ++i)
                bad[bad.size() / 2 + random() % (bad.size() / 2)] ^= static_cast<char>(1 << random() % 8);
        std::ofstream(file.path(), std::ios::binary) << bad;
        try {
            read_flash(file.path(), {}, execution());
        } catch (Error const&) {
            ++refused;
        }
    }
    EXPECT_GE(refused, 50); // all truncated ones at least
}

TEST(AmrEdit, MergedSiblingsAreTheSameVolume) {
    Volume const volume = make_amr(small_recipe(), execution());
    Volume const merged = merge_siblings(volume, 32, execution());
    validate_tree(merged.header().dims, merged.bricks(), Coverage::complete);
    EXPECT_LT(merged.header().brick_count, volume.header().brick_count);
    EXPECT_EQ(merged.header().cell_count, volume.header().cell_count);
    Index3 const dims{96, 32, 24};
    EXPECT_EQ(values_of<float>(reconstruct(volume, whole_grid(volume, dims), Reconstruction::nearest, 0, execution())),
              values_of<float>(reconstruct(merged, whole_grid(merged, dims), Reconstruction::nearest, 0, execution())));
    std::vector<float> const a =
        values_of<float>(reconstruct(volume, whole_grid(volume, {77, 41, 33}), Reconstruction::basis, 0, execution()));
    std::vector<float> const b =
        values_of<float>(reconstruct(merged, whole_grid(merged, {77, 41, 33}), Reconstruction::basis, 0, execution()));
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 1e-6 * std::abs(a[i]));
}

} // namespace
