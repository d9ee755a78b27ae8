// Parts of chunks that lie in files as they are: every region of every layout has the voxels of the whole.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/chunk_part.h"

#include <cstring>
#include <gtest/gtest.h>
#include <vector>

namespace {

using namespace vkt;

TEST(ChunkPart, RegionsHaveTheVoxelsOfTheChunk) {
    Index3 const extent{5, 4, 3}, corner{10, 20, 30};
    std::vector<std::uint16_t> chunk(60);
    for (std::size_t i = 0; i < chunk.size(); ++i) chunk[i] = static_cast<std::uint16_t>(1000 + i);
    std::size_t furthest = 0;
    auto const read = [&](std::int64_t at, std::byte* to, std::size_t n) {
        ASSERT_LE(static_cast<std::size_t>(at) + n, 120u);
        furthest = std::max(furthest, static_cast<std::size_t>(at) + n);
        std::memcpy(to, reinterpret_cast<std::byte const*>(chunk.data()) + at, n);
    };
    std::vector<std::byte> scratch;
    // Regions within the chunk, around it, and beyond one of its ends.
    for (Box const& region :
         {Box{{10, 20, 30}, {15, 24, 33}}, Box{{8, 18, 29}, {20, 27, 34}}, Box{{12, 21, 31}, {14, 23, 33}},
          Box{{10, 20, 31}, {15, 24, 32}}, Box{{10, 22, 30}, {15, 23, 33}}, Box{{13, 20, 30}, {30, 24, 31}}}) {
        std::vector<std::uint16_t> voxels(static_cast<std::size_t>(region.voxels()), 7);
        AnyView const out = dense_view(reinterpret_cast<std::byte*>(voxels.data()), DataType::uint16, region);
        read_chunk_part(corner, extent, out, scratch, read);
        std::size_t i = 0;
        for (std::int64_t z = region.lower.z; z < region.upper.z; ++z)
            for (std::int64_t y = region.lower.y; y < region.upper.y; ++y)
                for (std::int64_t x = region.lower.x; x < region.upper.x; ++x, ++i) {
                    Index3 const at = Index3{x, y, z} - corner;
                    bool const inside = Box{{}, extent}.contains(Box{at, at + Index3{1, 1, 1}});
                    EXPECT_EQ(voxels[i], inside ? 1000 + (at.z * 4 + at.y) * 5 + at.x : 7) << x << ' ' << y << ' ' << z;
                }
    }
    EXPECT_EQ(furthest, 120u);
}

TEST(ChunkPart, RowsOfEveryLength) {
    // Short ones are copied in blocks.
    for (std::int64_t width : {1, 63, 64, 65, 128, 192, 512, 576, 1024}) {
        Index3 const extent{width, 3, 2};
        std::vector<std::byte> chunk(static_cast<std::size_t>(width * 6)), scratch;
        for (std::size_t i = 0; i < chunk.size(); ++i) chunk[i] = static_cast<std::byte>(i * 7 % 251);
        Box const region{{0, 0, 0}, {width + 9, 3, 2}}; // wider than the chunk
        std::vector<std::byte> voxels(static_cast<std::size_t>(region.voxels()), std::byte{255});
        read_chunk_part({}, extent, dense_view(voxels.data(), DataType::uint8, region), scratch,
                        [&](std::int64_t at, std::byte* to, std::size_t n) { std::memcpy(to, chunk.data() + at, n); });
        for (std::int64_t row = 0; row < 6; ++row)
            for (std::int64_t x = 0; x < width + 9; ++x)
                ASSERT_EQ(voxels[static_cast<std::size_t>(row * (width + 9) + x)],
                          x < width ? chunk[static_cast<std::size_t>(row * width + x)] : std::byte{255})
                    << width << ' ' << row << ' ' << x;
    }
}

TEST(ChunkPart, LayersAreReadInEvenParts) {
    constexpr std::int64_t mib = std::int64_t{1} << 20;
    EXPECT_EQ(slices_together(64, mib / 2), 8);
    EXPECT_EQ(slices_together(10, mib / 2), 5); // not 8 and 2
    EXPECT_EQ(slices_together(64, 100 * mib), 1);
    EXPECT_EQ(slices_together(16, 1), 16);
    EXPECT_EQ(slices_together(1, 0), 1);
}

} // namespace
