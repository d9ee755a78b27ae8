// AMReX plotfiles: a real one against its own tables, and hand-written ones in every number format.
// SPDX-License-Identifier: MIT
#include "amr_helper.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/amrex.h"

#include <bit>

using namespace amr_test;

namespace {

TEST(AmrAmrex, ReadsARealPlotfile) {
    REQUIRE_DATA(folder);
    std::string const path = folder + "/plt_eb_3d";
    EXPECT_TRUE(is_amrex(path));
    AmrListing const listing = list_amrex(path);
    EXPECT_EQ(listing.header.dims, (Index3{128, 64, 32}));
    ASSERT_EQ(listing.variables.size(), 2u);
    EXPECT_EQ(listing.variables[1].name, "density");
    EXPECT_EQ(listing.blocks_in_file, 2);
    // The fine box covers half of the coarse one: 64*64*32 fine cells and 32*32*16 coarse ones are left.
    EXPECT_EQ(listing.header.cell_count, 64 * 64 * 32 + 32 * 32 * 16);
    EXPECT_NEAR(listing.header.geometry.spacing.x, 0.000625, 1e-12);
    EXPECT_NEAR(listing.header.geometry.origin.x, -0.02 + 0.5 * 0.000625, 1e-12);

    AmrReadOptions options;
    options.variable = "density";
    Volume const volume = read_amrex(path, options, execution());
    EXPECT_EQ(volume.header().dtype, DataType::float64);
    ValueRange const range = united(brick_ranges(volume, execution()));
    EXPECT_EQ(range.maximum, *listing.variables[1].maximum); // the fine level holds the largest value
    EXPECT_GE(range.minimum, *listing.variables[1].minimum);

    // A fine cell and an uncovered coarse one, straight from the files: the k-th number after the record's line.
    auto const raw = [&](char const* file, std::int64_t index) {
        std::ifstream in(path + "/" + file, std::ios::binary);
        std::string line;
        std::getline(in, line);
        in.seekg(static_cast<std::streamoff>(in.tellg()) + index * 8);
        double value = 0;
        in.read(reinterpret_cast<char*>(&value), 8);
        return value;
    };
    Volume const grid = reconstruct(volume, whole_grid(volume, {128, 64, 32}), Reconstruction::nearest, 0, execution());
    View<double const> const at = grid.view().as<double>();
    EXPECT_EQ(at(10, 20, 30), raw("Level_1/Cell_D_00000", 64 * 64 * 32 + (30 * 64 + 20) * 64 + 10));
    EXPECT_EQ(at(101, 20, 30), raw("Level_0/Cell_D_00000", 64 * 32 * 16 + (15 * 32 + 10) * 64 + 50));
}

void put(std::string const& path, std::string const& content) {
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    std::ofstream(path, std::ios::binary) << content;
}

/// A plotfile of two levels with ratio 4 and one ghost cell: cells are 1000 * level + x + 10 y + 100 z of their level.
std::string plotfile(std::string const& root, int bytes, bool big_endian) {
    std::string const format = bytes == 8 ? "(64 11 52 0 1 12 0 1023)" : "(32 8 23 0 1 9 0 127)";
    std::string order;
    for (int i = 0; i < bytes; ++i) order += text(i > 0 ? " " : "", big_endian ? i + 1 : bytes - i);
    auto const corner = [](Index3 v) { return text("(", v.x, ",", v.y, ",", v.z, ")"); };
    auto const record = [&](int level, Box const& box) {
        Box const grown = grow(box, {1, 1, 1});
        std::string data = "FAB ((8, " + format + "),(" + std::to_string(bytes) + ", (" + order + ")))(" +
                           corner(grown.lower) + " " + corner(grown.upper - Index3{1, 1, 1}) + " (0,0,0)) 1\n";
        for (std::int64_t z = grown.lower.z; z < grown.upper.z; ++z)
            for (std::int64_t y = grown.lower.y; y < grown.upper.y; ++y)
                for (std::int64_t x = grown.lower.x; x < grown.upper.x; ++x) {
                    bool const ghost = !box.contains({{x, y, z}, {x + 1, y + 1, z + 1}});
                    double const value =
                        ghost ? std::nan("") : static_cast<double>(1000 * level + x + 10 * y + 100 * z);
                    std::uint64_t const word = bytes == 8 ? std::bit_cast<std::uint64_t>(value)
                                                          : std::bit_cast<std::uint32_t>(static_cast<float>(value));
                    for (int i = 0; i < bytes; ++i)
                        data += static_cast<char>(word >> 8 * (big_endian ? bytes - 1 - i : i) & 0xff);
                }
        return data;
    };
    Box const coarse{{0, 0, 0}, {4, 3, 2}}, fine{{4, 4, 0}, {12, 8, 4}};
    put(root + "/Header",
        "CartGrid-V2.0\n1\nrho\n3\n0.25\n1\n0 0 0\n4 3 2\n4\n((0,0,0) (3,2,1) (0,0,0)) ((0,0,0) (15,11,7) (0,0,0))\n"
        "5 20\n1 1 1\n0.25 0.25 0.25\n0\n0\n0 1 0.25\n5\n0 4\n0 3\n0 2\nLevel_0/Cell\n1 1 0.25\n20\n1 3\n1 2\n0 "
        "1\nLevel_1/Cell\n");
    for (int level = 0; level < 2; ++level) {
        Box const box = level == 0 ? coarse : fine;
        std::string const folder = root + "/Level_" + std::to_string(level);
        put(folder + "/Cell_H", "1\n1\n1\n1\n(1 0\n(" + corner(box.lower) + " " + corner(box.upper - Index3{1, 1, 1}) +
                                    " (0,0,0))\n)\n1\nFabOnDisk: Cell_D_00000 0\n\n");
        put(folder + "/Cell_D_00000", record(level, box));
    }
    return root;
}

TEST(AmrAmrex, NumberFormatsGhostCellsAndRatioFour) {
    for (int const bytes : {4, 8})
        for (bool const big_endian : {false, true}) {
            TemporaryFile const root("plt" + std::to_string(bytes) + (big_endian ? "b" : "l"));
            plotfile(root.path(), bytes, big_endian);
            Volume const volume = read_amrex(root.path(), {}, execution());
            EXPECT_EQ(volume.header().dtype, bytes == 4 ? DataType::float32 : DataType::float64);
            EXPECT_EQ(volume.header().dims, (Index3{16, 12, 8}));
            EXPECT_EQ(volume.header().level_count, 3);
            EXPECT_EQ(volume.header().cell_count, 24 - 2 + 8 * 4 * 4); // the fine box covers two coarse cells
            Volume const grid =
                reconstruct(volume, whole_grid(volume, {16, 12, 8}), Reconstruction::nearest, -1, execution());
            for (std::int64_t z = 0; z < 8; ++z)
                for (std::int64_t y = 0; y < 12; ++y)
                    for (std::int64_t x = 0; x < 16; ++x) {
                        bool const fine = x >= 4 && x < 12 && y >= 4 && y < 8 && z < 4;
                        double const expected = fine ? static_cast<double>(1000 + x + 10 * y + 100 * z)
                                                     : static_cast<double>(x / 4 + 10 * (y / 4) + 100 * (z / 4));
                        double const value = bytes == 4 ? static_cast<double>(grid.view().as<float>()(x, y, z))
                                                        : grid.view().as<double>()(x, y, z);
                        ASSERT_EQ(value, expected) << x << " " << y << " " << z;
                    }
        }
}

/// What reading says, empty if it says nothing.
std::string complaint(std::string const& path) {
    try {
        read_amrex(path, {}, execution());
    } catch (Error const& error) {
        EXPECT_EQ(error.kind(), ErrorKind::data);
        return error.what();
    }
    return {};
}

void replace(std::string const& path, std::string const& from, std::string const& to) {
    std::ifstream in(path, std::ios::binary);
    std::string content((std::istreambuf_iterator<char>(in)), {});
    std::size_t const at = content.find(from);
    ASSERT_NE(at, std::string::npos) << path;
    put(path, content.replace(at, from.size(), to));
}

// Of all this the cells alone would tell nothing: they would be other cells, NaN or 5e241.
TEST(AmrAmrex, RefusesRecordsThatAreNotWhatTheHeaderSays) {
    auto const expect = [](char const* what, char const* file, std::string const& from, std::string const& to) {
        TemporaryFile const root("damaged");
        plotfile(root.path(), 8, false);
        replace(root.path() + "/Level_1/" + file, from, to);
        std::string const said = complaint(root.path());
        EXPECT_NE(said.find(what), std::string::npos) << "'" << said << "' lacks '" << what << "'";
        EXPECT_NE(said.find("Level_1/Cell_D_00000: the record at byte 0"), std::string::npos) << said;
    };
    expect("holds box", "Cell_D_00000", "(3,3,-1) (12,8,4)", "(2,3,-1) (11,8,4)"); // shifted
    expect("holds box", "Cell_D_00000", "(3,3,-1) (12,8,4)", "(3,3,-1) (12,8,3)"); // another shape
    expect("components", "Cell_D_00000", "(0,0,0)) 1\n", "(0,0,0)) 2\n");
    expect("holds box", "Cell_H", "1\n1\n1\n1\n(1 0", "1\n1\n1\n0\n(1 0"); // no ghost cells, says the header
    // The table of extremes, where there is one: cells are 1000 + 4…11 + 10 * (4…7) + 100 * (0…3).
    std::string const lines = "FabOnDisk: Cell_D_00000 0\n\n";
    std::string const table = lines + "1,1\n1044.0,\n\n1,1\n";
    expect("rho is stated to lie in 1044 to 1300", "Cell_H", lines, table + "1300.0,\n");
    TemporaryFile const root("whole");
    plotfile(root.path(), 8, false);
    replace(root.path() + "/Level_1/Cell_H", lines, table + "1381.0,\n");
    EXPECT_EQ(complaint(root.path()), "");
}

/// A plotfile of one level with two boxes of 2 x 2 x 2 cells in one file.
void two_boxes(std::string const& root, std::string const& first, std::int64_t second_at) {
    put(root + "/Header",
        "HyperCLaw-V1.1\n1\nrho\n3\n0\n0\n0 0 0\n4 2 2\n\n((0,0,0) (3,1,1) (0,0,0))\n0\n1 1 1\n0\n0\n0 2 "
        "0\n0\n0 2\n0 2\n0 2\n2 4\n0 2\n0 2\nLevel_0/Cell\n");
    put(root + "/Level_0/Cell_H",
        "1\n1\n1\n0\n(2 0\n((0,0,0) (1,1,1) (0,0,0))\n((2,0,0) (3,1,1) (0,0,0))\n)\n2\nFabOnDisk: Cell_D_00000 "
        "0\nFabOnDisk: Cell_D_00000 " +
            std::to_string(second_at) + "\n\n");
    std::string const line = "FAB ((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))((2,0,0) (3,1,1) (0,0,0)) 1\n";
    put(root + "/Level_0/Cell_D_00000", first + line + std::string(64, '\0'));
}

TEST(AmrAmrex, RefusesRecordsThatLostBytesOrOverlap) {
    TemporaryFile const root("two");
    std::string const line = "FAB ((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))((0,0,0) (1,1,1) (0,0,0)) 1\n";
    std::string const whole = line + std::string(64, '\0');
    auto const second = static_cast<std::int64_t>(whole.size());
    two_boxes(root.path(), whole, second);
    EXPECT_EQ(complaint(root.path()), "");
    two_boxes(root.path(), whole.substr(0, whole.size() - 5), second);
    EXPECT_NE(complaint(root.path()).find("byte 0 of box"), std::string::npos) << complaint(root.path());
    two_boxes(root.path(), whole.substr(0, whole.size() - 5), second - 5);
    EXPECT_NE(complaint(root.path()).find("reaches into the one at byte"), std::string::npos) << complaint(root.path());
    two_boxes(root.path(), whole, 0);
    EXPECT_NE(complaint(root.path()).find("two boxes"), std::string::npos) << complaint(root.path());
}

TEST(AmrAmrex, RefusesGeometriesOtherThanCartesian) {
    for (int const system : {1, 2}) {
        TemporaryFile const root("system");
        plotfile(root.path(), 8, false);
        replace(root.path() + "/Header", "0.25 0.25 0.25\n0\n0\n", text("0.25 0.25 0.25\n", system, "\n0\n"));
        EXPECT_NE(complaint(root.path()).find(system == 1 ? "cylindrical" : "spherical"), std::string::npos);
    }
}

TEST(AmrAmrex, RefusesBrokenFiles) {
    TemporaryFile const root("broken");
    plotfile(root.path(), 8, false);
    std::filesystem::resize_file(root.path() + "/Level_1/Cell_D_00000", 300);
    EXPECT_THROW(read_amrex(root.path(), {}, execution()), Error);
    put(root.path() + "/Header", "CartGrid-V2.0\n1\nrho\n3\n");
    EXPECT_THROW(read_amrex(root.path(), {}, execution()), Error);
    put(root.path() + "/Header", "x\n99999999999\n");
    EXPECT_THROW(list_amrex(root.path()), Error);
    EXPECT_FALSE(is_amrex("/"));
}

} // namespace
