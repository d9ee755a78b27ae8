// FLASH files against independent references: yt's covering and arbitrary grids, a brute-force basis sum, positions.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/formats/flash.h"

using namespace amr_test;

namespace {

struct Oracle {
    char const* file;  ///< of amr/oracle
    char const* flash; ///< of amr/flash
    char const* variable;
    Reconstruction method;
    Index3 dims;
    char const* roi;
    double tolerance; ///< relative to the largest value of the file
};

std::ostream& operator<<(std::ostream& out, Oracle const& oracle) { return out << oracle.file; }

char const* const cubic = "synth3d_cubic_hdf5_plt_cnt_0000";
char const* const noncubic = "synth3d_noncubic_hdf5_chk_0000";

class AmrOracle : public testing::TestWithParam<Oracle> {};

TEST_P(AmrOracle, MatchesReference) {
    REQUIRE_DATA(folder);
    Oracle const& oracle = GetParam();
    std::vector<float> const expected = read_raw(folder + "/oracle/" + oracle.file);
    ASSERT_EQ(static_cast<std::int64_t>(expected.size()), oracle.dims.x * oracle.dims.y * oracle.dims.z);
    AmrReadOptions options;
    options.variable = oracle.variable;
    options.dtype = DataType::float32;
    options.roi = {oracle.roi};
    Volume const volume = read_flash(folder + "/flash/" + oracle.flash, options, execution());
    Volume const result = reconstruct(volume, whole_grid(volume, oracle.dims), oracle.method, 0, execution());
    float const* const values = cells_of<float>(result);
    double largest = 0, worst = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
        largest = std::max(largest, std::abs(static_cast<double>(expected[i])));
        worst = std::max(worst, std::abs(static_cast<double>(values[i]) - static_cast<double>(expected[i])));
    }
    ASSERT_GT(largest, 0);
    EXPECT_LE(worst, oracle.tolerance * largest);
}

INSTANTIATE_TEST_SUITE_P(
    Files, AmrOracle,
    testing::Values(
        Oracle{"cubic_average_dens_40x36x72.raw", cubic, "dens", Reconstruction::average, {40, 36, 72}, "", 1e-6},
        Oracle{"cubic_average_linr_40x36x72.raw", cubic, "linr", Reconstruction::average, {40, 36, 72}, "", 1e-6},
        Oracle{"cubic_basis_cons_40x36x72.raw", cubic, "cons", Reconstruction::basis, {40, 36, 72}, "", 2.5e-7},
        Oracle{"cubic_basis_dens_40x36x72.raw", cubic, "dens", Reconstruction::basis, {40, 36, 72}, "", 1e-6},
        Oracle{"cubic_basis_linr_40x36x72.raw", cubic, "linr", Reconstruction::basis, {40, 36, 72}, "", 1e-6},
        Oracle{"cubic_basis_linr_roi10-20-30_34-44-54_48x48x48.raw",
               cubic,
               "linr",
               Reconstruction::basis,
               {48, 48, 48},
               "10:34,20:44,30:54",
               1e-6},
        Oracle{"cubic_nearest_levl_64x64x128.raw", cubic, "levl", Reconstruction::nearest, {64, 64, 128}, "", 0},
        Oracle{"noncubic_average_dens_50x30x20.raw", noncubic, "dens", Reconstruction::average, {50, 30, 20}, "", 1e-6},
        Oracle{"noncubic_average_linr_50x30x20.raw", noncubic, "linr", Reconstruction::average, {50, 30, 20}, "", 1e-6},
        Oracle{"noncubic_basis_linr_50x30x20.raw", noncubic, "linr", Reconstruction::basis, {50, 30, 20}, "", 1e-6},
        Oracle{"noncubic_nearest_levl_96x32x24.raw", noncubic, "levl", Reconstruction::nearest, {96, 32, 24}, "", 0}),
    [](auto const& entry) {
        std::string name = entry.param.file;
        for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
        return name;
    });

Volume read(std::string const& file, std::string const& variable) {
    AmrReadOptions options;
    options.variable = variable;
    return read_flash(file, options, execution());
}

// Test 16: posx, posy and posz hold the cells' centres, so a wrong axis order or lattice shows at once.
TEST(AmrFlash, PositionsAreCellCentres) {
    REQUIRE_DATA(folder);
    for (char const* file : {cubic, noncubic, "synth3d_guard2_hdf5_chk_0000"})
        for (int a = 0; a < 3; ++a) {
            Volume const volume =
                read(folder + "/flash/" + file, std::array{"posx", "posy", "posz"}[static_cast<std::size_t>(a)]);
            Geometry const& geometry = volume.header().geometry;
            bool const wide = volume.header().dtype == DataType::float64;
            double const scale =
                std::abs(geometry.origin[a]) + geometry.spacing[a] * static_cast<double>(volume.header().dims[a]);
            double worst = 0;
            for (std::size_t b = 0; b < volume.bricks().size(); ++b) {
                Brick const& brick = volume.bricks()[b];
                ConstView const view = volume.brick_view(b);
                for (std::int64_t i = 0; i < brick.cells(); ++i) {
                    Index3 const at{i % brick.dims.x, i / brick.dims.x % brick.dims.y,
                                    i / (brick.dims.x * brick.dims.y)};
                    double const logical =
                        static_cast<double>(brick.lower[a]) +
                        (static_cast<double>(at[a]) + 0.5) * static_cast<double>(brick.cell_width()) - 0.5;
                    double const world = geometry.origin[a] + geometry.spacing[a] * logical;
                    double const cell = wide ? view.as<double>()(at.x, at.y, at.z)
                                             : static_cast<double>(view.as<float>()(at.x, at.y, at.z));
                    worst = std::max(worst, std::abs(cell - world) / scale);
                }
            }
            EXPECT_LE(worst, wide ? 1e-14 : 1e-7) << file << " axis " << a;
        }
}

TEST(AmrFlash, SizesOfKnownFiles) {
    REQUIRE_DATA(folder);
    AmrListing const first = list_flash(folder + "/flash/" + cubic);
    EXPECT_EQ(first.blocks_in_file, 274);
    EXPECT_EQ(first.header.brick_count, 240);
    EXPECT_EQ(first.header.cell_count, 122880);
    EXPECT_EQ(first.header.dims, (Index3{64, 64, 128}));
    TreeSummary const levels = summarise(first.header.dims, first.bricks);
    ASSERT_EQ(levels.levels.size(), 3u);
    EXPECT_EQ(levels.levels[0].bricks, 160);
    EXPECT_EQ(levels.levels[1].bricks, 76);
    EXPECT_EQ(levels.levels[2].bricks, 4);
    EXPECT_EQ(levels.covered, levels.logical);
    std::vector<std::string> names;
    for (auto const& variable : first.variables) names.push_back(variable.name);
    EXPECT_EQ(names, (std::vector<std::string>{"dens", "cons", "posx", "posy", "posz", "linr", "levl"}));

    AmrListing const second = list_flash(folder + "/flash/" + noncubic);
    EXPECT_EQ(second.header.brick_count, 118);
    EXPECT_EQ(second.header.dims, (Index3{96, 32, 24}));
    EXPECT_EQ(second.variables.front().dtype, DataType::float64);
}

// Tests 18 and 19: real 1-D and 2-D files.
TEST(AmrFlash, RealFilesOfOneAndTwoDimensions) {
    REQUIRE_DATA(folder);
    AmrListing const plane = list_flash(folder + "/flash/laminartest_hdf5_plt_cnt_0000");
    EXPECT_EQ(plane.dimensions, 2);
    EXPECT_EQ(plane.header.dims, (Index3{144, 24, 1}));
    EXPECT_EQ(plane.variables.size(), 7u);
    EXPECT_NEAR(plane.header.geometry.spacing.x, 0.0625, 1e-7);
    EXPECT_NEAR(plane.header.geometry.spacing.y, 0.041667, 1e-5);
    Volume const flow = read(folder + "/flash/laminartest_hdf5_plt_cnt_0000", plane.variables.front().name);
    Volume const same = reconstruct(flow, whole_grid(flow, flow.header().dims), Reconstruction::basis, 0, execution());
    Volume const nearest =
        reconstruct(flow, whole_grid(flow, flow.header().dims), Reconstruction::nearest, 0, execution());
    EXPECT_EQ(values_of<float>(same), values_of<float>(nearest)); // one level at its own grid
    ValueRange const range = united(brick_ranges(flow, execution()));
    EXPECT_NEAR(range.minimum, *plane.variables.front().minimum, 1e-6 * std::abs(range.minimum) + 1e-30);
    EXPECT_NEAR(range.maximum, *plane.variables.front().maximum, 1e-6 * std::abs(range.maximum) + 1e-30);

    AmrListing const line = list_flash(folder + "/flash/blast2_hdf5_chk_0018");
    EXPECT_EQ(line.dimensions, 1);
    EXPECT_EQ(line.variables.size(), 13u);
    EXPECT_EQ(line.header.dims.y, 1);
    EXPECT_EQ(line.header.dims.z, 1);
    Volume const blast = read(folder + "/flash/blast2_hdf5_chk_0018", "dens");
    EXPECT_EQ(blast.header().dtype, DataType::float64);
    EXPECT_EQ(summarise(blast.header().dims, blast.bricks()).covered, static_cast<double>(blast.header().dims.x));
    Volume const mean = reconstruct(blast, whole_grid(blast, {100, 1, 1}), Reconstruction::average, 0, execution());
    double total = 0, expected = 0;
    for (double const v : values_of<double>(mean)) total += v / 100;
    double const* cell = cells_of<double>(blast);
    for (Brick const& brick : blast.bricks())
        for (std::int64_t i = 0; i < brick.cells(); ++i)
            expected += *cell++ * static_cast<double>(brick.cell_width()) / static_cast<double>(blast.header().dims.x);
    EXPECT_NEAR(total, expected, 1e-12 * expected);
}

// Test 17: guard cells are stripped: same tree and field with and without them.
TEST(AmrFlash, GuardCellsAreStripped) {
    REQUIRE_DATA(folder);
    AmrListing const listing = list_flash(folder + "/flash/synth3d_guard2_hdf5_chk_0000");
    for (Brick const& brick : listing.bricks) EXPECT_EQ(brick.dims, (Index3{8, 8, 8}));
    Volume const volume = read(folder + "/flash/synth3d_guard2_hdf5_chk_0000", "cons");
    ValueRange const range = united(brick_ranges(volume, execution()));
    EXPECT_EQ(range.minimum, 1);
    EXPECT_EQ(range.maximum, 1);
}

TEST(AmrFlash, RefusesWhatIsNoFlashFile) {
    REQUIRE_DATA(folder);
    EXPECT_THROW(list_flash(folder + "/oracle/cubic_basis_cons_40x36x72.raw"), Error);
    EXPECT_THROW(list_flash(folder + "/flash/missing"), Error);
    AmrReadOptions options;
    options.variable = "dems";
    try {
        read_flash(folder + "/flash/" + cubic, options, execution());
        FAIL() << "an unknown variable was read";
    } catch (Error const& error) {
        EXPECT_EQ(error.kind(), ErrorKind::usage);
        EXPECT_NE(error.hint().find("dens"), std::string::npos);
    }
}

} // namespace
