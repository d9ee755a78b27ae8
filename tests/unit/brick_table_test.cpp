// Tables of bricks: packed they say what their records say, in a fraction of the bytes, and nothing else is taken for
// one.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/tree.h"
#include "libvkt/core/error.h"

#include <gtest/gtest.h>

#include <bit>
#include <random>

namespace vkt {
namespace {

/// Blocks of an octree, split here and there, with short ones at the end of the grid as refine makes them.
std::vector<Brick> forest(Index3 logical, Index3 block, int coarsest, unsigned seed) {
    std::vector<Brick> bricks;
    std::mt19937 random(seed);
    auto const add = [&](auto const& self, Index3 lower, int level) -> void {
        Index3 const w = cell_width(logical, level);
        bool fits = true, inside = true;
        for (int a = 0; a < 3; ++a) {
            fits = fits && lower[a] + block[a] * w[a] <= logical[a];
            inside = inside && lower[a] < logical[a];
        }
        if (!inside) return;
        if (level == 0 || (fits && random() % 3 > 0)) {
            Brick brick{lower, block, level};
            for (int a = 0; a < 3; ++a) brick.dims[a] = std::min(block[a], (logical[a] - lower[a]) / w[a]);
            bricks.push_back(brick);
            return;
        }
        Index3 const half = cell_width(logical, level - 1);
        for (int i = 0; i < 8; ++i) {
            Index3 at = lower;
            bool is = true;
            for (int a = 0; a < 3; ++a) {
                is = is && (logical[a] > 1 || (i >> a & 1) == 0);
                at[a] += (i >> a & 1) * block[a] * half[a];
            }
            if (is) self(self, at, level - 1);
        }
    };
    Index3 const root = cell_width(logical, coarsest);
    for (std::int64_t z = 0; z < logical.z; z += block.z * root.z)
        for (std::int64_t y = 0; y < logical.y; y += block.y * root.y)
            for (std::int64_t x = 0; x < logical.x; x += block.x * root.x) add(add, {x, y, z}, coarsest);
    return bricks;
}

Header header_of(Index3 dims, std::vector<Brick> const& bricks) {
    Header header;
    header.dims = dims;
    return with_counts(header, bricks);
}

/// Numbers as a stream has them.
std::vector<std::uint32_t> words_of(BrickTable const& table) { return {table.words().begin(), table.words().end()}; }

TEST(BrickTable, PackedBricksAreThoseOfTheirRecords) {
    struct Case {
        Index3 dims, block;
        int coarsest;
        std::size_t words;
    };
    for (Case const& c : {Case{{64, 64, 64}, {8, 8, 8}, 2, 1}, Case{{67, 35, 50}, {4, 4, 4}, 3, 1},
                          Case{{90, 77, 1}, {4, 4, 1}, 3, 1}, Case{{50, 1, 1}, {7, 1, 1}, 2, 1}}) {
        std::vector<Brick> const bricks = forest(c.dims, c.block, c.coarsest, 5);
        ASSERT_GT(bricks.size(), 4U);
        BrickTable const table(c.dims, bricks);
        ASSERT_EQ(table.words().size(), bricks.size() * c.words);
        EXPECT_EQ(table.list(), bricks);
        EXPECT_TRUE(table == BrickTable(bricks));
        EXPECT_LE(table.bytes(), 4 * bricks.size() + bricks.size() / 2 + 16);
        std::int64_t before = 0;
        for (std::size_t i = 0; i <= bricks.size(); ++i) {
            EXPECT_EQ(table.offset(i), before);
            if (i < bricks.size()) before += bricks[i].cells();
        }
        EXPECT_EQ(table.part(2, 2).list(), std::vector<Brick>(bricks.begin() + 2, bricks.begin() + 4));
        // There and back as a stream has them.
        Header const header = header_of(c.dims, bricks);
        auto const packing = BrickPacking::of_record(table.packing_for(header), header);
        ASSERT_TRUE(packing);
        EXPECT_TRUE(table_of_numbers(*packing, words_of(table), header) == table);
    }
    // Of a grid of 2^40 cells an axis two words are enough for large blocks, and nothing is for small ones.
    std::int64_t const far = std::int64_t{1} << 40;
    for (std::int64_t const edge : {std::int64_t{1} << 21, std::int64_t{8}}) {
        std::vector<Brick> const bricks{{{0, 0, 0}, {edge, 1, 1}, 0},
                                        {{far - edge, far / 2, far - 1}, {edge, 1, 1}, 0}};
        BrickTable const table({far, far, far}, bricks);
        EXPECT_EQ(table.list(), bricks);
        EXPECT_TRUE(table.words().empty());
    }
    std::vector<Brick> const wide{{{0, 0, 0}, {256, 256, 256}, 0}, {{1 << 20, 1 << 19, 256}, {256, 256, 256}, 7}};
    BrickTable const table({1 << 24, 1 << 24, 1 << 24}, wide);
    EXPECT_EQ(table.words().size(), 4U);
    EXPECT_EQ(table.list(), wide);
}

TEST(BrickTable, SizesMayBeDoubled) {
    struct Case {
        Index3 dims;
        std::vector<Brick> bricks;
        std::size_t words;
    };
    for (Case const& c :
         {Case{{16, 8, 8}, {{{0, 0, 0}, {8, 8, 8}, 0}, {{8, 0, 0}, {2, 2, 2}, 0}, {{12, 4, 4}, {2, 2, 2}, 1}}, 1},
          // Short at the end of the grid, of which the size cannot be told; and one that is as large as the grid is
          // thick.
          Case{{11, 8, 7}, {{{0, 0, 0}, {8, 8, 7}, 0}, {{8, 0, 0}, {2, 2, 2}, 0}, {{10, 0, 0}, {1, 2, 2}, 0}}, 1},
          Case{{32, 16, 1}, {{{0, 0, 0}, {16, 16, 1}, 0}, {{16, 0, 0}, {4, 4, 1}, 0}, {{24, 8, 0}, {4, 4, 1}, 1}}, 1},
          Case{{1 << 20, 1 << 20, 4096}, {{{0, 0, 0}, {32, 32, 32}, 0}, {{64, 64, 64}, {4, 4, 4}, 3}}, 2}}) {
        BrickTable const table(c.dims, c.bricks);
        ASSERT_EQ(table.words().size(), c.bricks.size() * c.words);
        EXPECT_EQ(table.list(), c.bricks);
        EXPECT_EQ(table.offset(2), c.bricks[0].cells() + c.bricks[1].cells());
        Header const header = header_of(c.dims, c.bricks);
        PackingRecord const record = table.packing_for(header);
        EXPECT_GT(record.doublings, 0);
        auto const packing = BrickPacking::of_record(record, header);
        ASSERT_TRUE(packing);
        EXPECT_TRUE(table_of_numbers(*packing, words_of(table), header) == table);
        // The second is no brick if it is doubled more often than the record says, and has other cells where it may be.
        std::vector<std::uint32_t> words = words_of(table);
        words[c.words] |=
            3U << (header.level_count > 1 ? std::bit_width(static_cast<unsigned>(header.level_count - 1)) : 0);
        EXPECT_THROW(table_of_numbers(*packing, std::move(words), header), Error);
    }
    for (std::vector<Brick> const& bricks :
         {std::vector<Brick>{{{0, 0, 0}, {6, 6, 6}, 0}, {{6, 0, 0}, {2, 2, 2}, 0}},            // three times as large
          std::vector<Brick>{{{0, 0, 0}, {4, 4, 4}, 0}, {{4, 0, 0}, {4, 4, 2}, 0}},            // doubled along two axes
          std::vector<Brick>{{{0, 0, 0}, {256, 256, 256}, 0}, {{256, 0, 0}, {1, 1, 1}, 0}}}) { // too often
        BrickTable const table({512, 512, 512}, bricks);
        EXPECT_TRUE(table.words().empty());
        EXPECT_EQ(table.list(), bricks);
    }
}

TEST(BrickTable, OtherBricksKeepTheirRecords) {
    Index3 const dims{32, 32, 32};
    for (std::vector<Brick> const& bricks :
         {std::vector<Brick>{{{0, 0, 0}, {8, 8, 8}, 0}, {{4, 8, 8}, {8, 8, 8}, 0}},  // off the lattice
          std::vector<Brick>{{{0, 0, 0}, {8, 8, 8}, 0}, {{8, 0, 0}, {8, 8, 4}, 0}},  // short, but not at the end
          std::vector<Brick>{{{0, 0, 0}, {4, 4, 4}, 0}, {{4, 0, 0}, {4, 4, 4}, 3}},  // off the lattice of its cells
          std::vector<Brick>{{{0, 0, 0}, {8, 8, 8}, 0}, {{-8, 0, 0}, {8, 8, 8}, 0}}, // outside
          std::vector<Brick>{{{0, 0, 0}, {64, 8, 8}, 0}},                            // larger than the grid
          std::vector<Brick>{{{0, 0, 0}, {8, 8, 8}, 0}, {{8, 0, 0}, {8, 8, 8}, -1}}}) {
        BrickTable const table(dims, bricks);
        EXPECT_TRUE(table.words().empty());
        EXPECT_EQ(table.list(), bricks);
        EXPECT_EQ(table.offset(1), bricks[0].cells());
    }
}

TEST(BrickTable, ForgedTablesAreRefused) {
    Index3 const dims{37, 32, 32};
    std::vector<Brick> const bricks = forest(dims, {4, 4, 4}, 2, 9);
    BrickTable const table(dims, bricks);
    Header const header = header_of(dims, bricks);
    PackingRecord const record = table.packing_for(header);
    auto const packing = *BrickPacking::of_record(record, header);
    for (PackingRecord const& forged :
         {PackingRecord{{0, 4, 4}, 1}, PackingRecord{{-4, 4, 4}, 1}, PackingRecord{{38, 4, 4}, 1},
          PackingRecord{{4, 4, 4}, 0}, PackingRecord{{4, 4, 4}, 2}, PackingRecord{{4, 4, 4}, 0x8000},
          PackingRecord{{4, 4, 4}, 1, 8}, PackingRecord{{4, 4, 4}, 1, 0x8000}})
        EXPECT_FALSE(BrickPacking::of_record(forged, header));
    Header other = header;
    for (int const levels : {0, -1, max_level + 2, 1 << 30}) {
        other.level_count = levels;
        EXPECT_FALSE(BrickPacking::of_record(record, other));
    }
    // A header that packs otherwise gets records.
    other.level_count = header.level_count + 4;
    EXPECT_EQ(table.packing_for(other).words, 0U);
    auto const refused = [&](auto const& change) {
        std::vector<std::uint32_t> words = words_of(table);
        change(words);
        EXPECT_THROW(table_of_numbers(packing, std::move(words), header), Error);
    };
    refused([](auto& w) { w[0] |= 3; });             // a level that is none
    refused([](auto& w) { w[0] |= 0x80000000U; });   // bits that mean nothing
    refused([](auto& w) { w[1] = 0xffffffffU; });    //
    refused([](auto& w) { w[0] |= 15U << 2; });      // beyond the end
    refused([](auto& w) { w.pop_back(); });          // too few cells
    refused([](auto& w) { w.push_back(w.back()); }); // too many
    refused([](auto& w) { w[1] = w[0]; });           // one twice
    // One that covers others, with equally many cells.
    std::size_t fine = 0;
    while (bricks[fine].level > 0 || bricks[fine].lower.x % 8 != 0 || bricks[fine].dims.x < 4) ++fine;
    refused([&](auto& w) { w[fine] |= 1; });
}

} // namespace
} // namespace vkt
