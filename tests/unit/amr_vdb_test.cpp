// OpenVDB files: a real fog volume against its stated statistics, and round trips of every kind.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/core/half.h"
#include "libvkt/formats/vdb.h"

using namespace amr_test;

namespace {

#define REQUIRE_OPENVDB()                                                                                              \
    if (!built_with_openvdb()) GTEST_SKIP() << "built without OpenVDB"

TEST(AmrVdb, ReadsARealFogVolume) {
    REQUIRE_OPENVDB();
    REQUIRE_DATA(folder);
    std::string const path = folder + "/../vdb/smoke.vdb";
    AmrListing const listing = list_vdb(path);
    ASSERT_EQ(listing.variables.size(), 1u);
    EXPECT_EQ(listing.variables[0].name, "density");
    Volume const volume = read_vdb(path, {}, execution());
    Header const& header = volume.header();
    EXPECT_EQ(header.dtype, DataType::float16);
    EXPECT_EQ(header.attributes.at("background"), "0");
    EXPECT_EQ(header.attributes.at("class"), "fog volume");
    validate_tree(header.dims, volume.bricks(), Coverage::may_have_holes);
    // The statistics of data/SOURCES.md, over the active box with the background filled in.
    EXPECT_EQ(region_of(header).dims(), (Index3{111, 222, 112}));
    EXPECT_NEAR(header.geometry.spacing.x, 0.47619, 1e-5);
    Volume const dense = reconstruct(volume, plan_grid(header, {}), Reconstruction::nearest, 0, execution());
    EXPECT_EQ(dense.header().dims, (Index3{111, 222, 112}));
    double sum = 0, largest = 0;
    std::int64_t positive = 0;
    Half const* const values = cells_of<Half>(dense);
    for (std::int64_t i = 0; i < dense.header().voxels(); ++i) {
        auto const v = static_cast<double>(static_cast<float>(values[i]));
        sum += v;
        largest = std::max(largest, v);
        positive += v > 0 ? 1 : 0;
    }
    EXPECT_EQ(largest, 5.71484375);
    EXPECT_NEAR(sum / static_cast<double>(dense.header().voxels()), 0.0621397322, 1e-9);
    EXPECT_EQ(positive, 1049275); // the active voxels
}

template <class T> Volume structured(DataType type, Index3 dims) {
    Header header;
    header.dims = dims;
    header.dtype = type;
    header.geometry.origin = {-3, 5, 7};
    header.geometry.spacing = {0.5, 0.25, 2};
    header.geometry.direction = {{{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}}};
    Volume volume(header);
    View<T> const view = volume.mutable_view().as<T>();
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x)
                view(x, y, z) =
                    x > 12 && y < 9 ? static_cast<T>(static_cast<float>(x + 3 * y + 5 * z)) : static_cast<T>(0.0f);
    return volume;
}

double voxel(Volume const& volume, std::int64_t x, std::int64_t y, std::int64_t z) {
    switch (volume.header().dtype) {
    case DataType::float16:
        return static_cast<double>(volume.view().as<Half>()(x, y, z));
    case DataType::float32:
        return static_cast<double>(volume.view().as<float>()(x, y, z));
    case DataType::float64:
        return volume.view().as<double>()(x, y, z);
    case DataType::int32:
        return volume.view().as<std::int32_t>()(x, y, z);
    default:
        return static_cast<double>(volume.view().as<std::int64_t>()(x, y, z));
    }
}

template <class T> void round_trip(DataType type, DataType read_type) {
    Index3 const dims{37, 21, 13};
    Volume const volume = structured<T>(type, dims);
    TemporaryFile const file("grid.vdb");
    VdbWriteOptions options;
    options.name = "thing";
    write_vdb(volume, file.path(), options);
    Volume const tree = read_vdb(file.path(), {}, execution());
    EXPECT_EQ(tree.header().dtype, read_type);
    EXPECT_EQ(tree.header().attributes.at("variable"), "thing");
    // Only the part that is not background is stored, but the file says how large the volume was.
    Vec3 const first = world_to_index(volume.header().geometry, index_to_world(tree.header().geometry, {0, 0, 0}));
    Volume const dense = reconstruct(tree, plan_grid(tree.header(), {}), Reconstruction::nearest, 0, execution());
    Index3 const shift = region_of(tree.header()).lower;
    View<T const> const expected = volume.view().as<T>();
    EXPECT_EQ(dense.header().dims, dims);
    EXPECT_LT(tree.header().cell_count, volume.header().voxels());
    for (std::int64_t z = 0; z < dense.header().dims.z; ++z)
        for (std::int64_t y = 0; y < dense.header().dims.y; ++y)
            for (std::int64_t x = 0; x < dense.header().dims.x; ++x) {
                auto const at = [&](std::int64_t i, int a) { return i + shift[a] + std::llround(first[a]); };
                ASSERT_EQ(voxel(dense, x, y, z),
                          static_cast<double>(static_cast<float>(expected(at(x, 0), at(y, 1), at(z, 2)))));
            }
}

TEST(AmrVdb, StructuredRoundTripsInEveryType) {
    REQUIRE_OPENVDB();
    round_trip<std::uint8_t>(DataType::uint8, DataType::int32);
    round_trip<std::int16_t>(DataType::int16, DataType::int32);
    round_trip<std::int32_t>(DataType::int32, DataType::int32);
    round_trip<std::uint32_t>(DataType::uint32, DataType::int64);
    round_trip<Half>(DataType::float16, DataType::float16);
    round_trip<float>(DataType::float32, DataType::float32);
    round_trip<double>(DataType::float64, DataType::float64);
    TemporaryFile const file("no.vdb");
    EXPECT_THROW(write_vdb(structured<std::uint64_t>(DataType::uint64, {2, 3, 4}), file.path(), {}), Error);
}

TEST(AmrVdb, TreesSurviveAsTheSameFunction) {
    REQUIRE_OPENVDB();
    AmrRecipe recipe;
    recipe.roots = {2, 1, 1};
    recipe.finest = 5;
    recipe.blocks = 30;
    Volume const volume = make_amr(recipe, execution());
    EXPECT_GE(volume.header().level_count, 4);
    TemporaryFile const file("tree.vdb");
    write_vdb(volume, file.path(), {});
    Volume const back = read_vdb(file.path(), {}, execution());
    validate_tree(back.header().dims, back.bricks(), Coverage::complete);
    EXPECT_EQ(back.header().dims, volume.header().dims);
    EXPECT_GT(back.header().level_count, 1); // coarse cells became tiles
    Volume const a = reconstruct(volume, plan_grid(volume.header(), {}), Reconstruction::nearest, 0, execution());
    Volume const b = reconstruct(back, plan_grid(back.header(), {}), Reconstruction::nearest, 0, execution());
    EXPECT_EQ(values_of<float>(a), values_of<float>(b));
}

TEST(AmrVdb, PruningStaysWithinItsTolerance) {
    REQUIRE_OPENVDB();
    Volume const volume = structured<float>(DataType::float32, {40, 40, 40});
    TemporaryFile const exact("exact.vdb"), pruned("pruned.vdb");
    write_vdb(volume, exact.path(), {});
    VdbWriteOptions options;
    options.prune = 30;
    write_vdb(volume, pruned.path(), options);
    EXPECT_LT(std::filesystem::file_size(pruned.path()), std::filesystem::file_size(exact.path()));
    Volume const a = read_vdb(exact.path(), {}, execution()), b = read_vdb(pruned.path(), {}, execution());
    EXPECT_LE(b.header().cell_count, a.header().cell_count);
}

TEST(AmrVdb, RefusesOtherFiles) {
    REQUIRE_OPENVDB();
    TemporaryFile const file("text.vdb");
    std::ofstream(file.path()) << "not a volume";
    EXPECT_THROW(list_vdb(file.path()), Error);
    EXPECT_THROW(read_vdb(file.path() + ".missing", {}, execution()), Error);
    write_vdb(structured<float>(DataType::float32, {9, 9, 9}), file.path(), {});
    AmrReadOptions options;
    options.variable = "temperature";
    EXPECT_THROW(read_vdb(file.path(), options, execution()), Error);
    std::filesystem::resize_file(file.path(), std::filesystem::file_size(file.path()) / 2);
    EXPECT_THROW(read_vdb(file.path(), {}, execution()), Error);
}

} // namespace
