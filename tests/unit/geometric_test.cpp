// Flip, fill and crop on every data type, by definition; sizes beyond 32 bits.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/pipeline.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/beside.h"
#include "libvkt/operations/voxels/crop.h"
#include "libvkt/operations/voxels/fill.h"
#include "libvkt/operations/voxels/flip.h"
#include "tests/unit/volumes.h"

#include <gtest/gtest.h>

#include <limits>

namespace vkt {
namespace {

Execution with(int threads, std::int64_t slab, InstructionSet set = best_instruction_set()) {
    Execution execution;
    execution.threads = threads;
    execution.slab = slab;
    execution.instructions = set;
    return execution;
}

/// Random bytes: NaN payloads and negative zeros included.
Volume bytes_volume(Index3 dims, DataType type) {
    Volume volume(header_of(dims, type));
    std::mt19937 random(11);
    AnyView const view = volume.mutable_view();
    for (std::size_t i = 0; i < view.bytes(); ++i) view.data[i] = static_cast<std::byte>(random() & 255);
    return volume;
}

bool same_voxel(ConstView a, Index3 p, ConstView b, Index3 q) {
    return std::memcmp(a.at(p.x, p.y, p.z), b.at(q.x, q.y, q.z), size_of(a.type)) == 0;
}

TEST(Flip, ReversesOneAxisForEveryTypeAndCut) {
    for (int t = 0; t < data_type_count; ++t)
        for (Index3 dims : {Index3{7, 6, 5}, Index3{70, 3, 4}, Index3{1, 9, 2}})
            for (Axis axis : {Axis::x, Axis::y, Axis::z}) {
                Volume const in = bytes_volume(dims, static_cast<DataType>(t));
                Flip flip(axis);
                for (InstructionSet set : {InstructionSet::baseline, best_instruction_set()})
                    for (std::int64_t slab : {1, 2, 7}) {
                        Volume const out = apply(flip, {in}, with(2, slab, set));
                        for (std::int64_t z = 0; z < dims.z; ++z)
                            for (std::int64_t y = 0; y < dims.y; ++y)
                                for (std::int64_t x = 0; x < dims.x; ++x) {
                                    Index3 from{x, y, z};
                                    int const a = static_cast<int>(axis);
                                    from[a] = dims[a] - 1 - from[a];
                                    ASSERT_TRUE(same_voxel(in.view(), from, out.view(), {x, y, z}));
                                }
                        ASSERT_TRUE(same_voxels(apply(flip, {out}, with(1, slab, set)), in));
                    }
            }
}

TEST(Flip, StaysWithinItsRegion) {
    Volume const in = bytes_volume({12, 10, 8}, DataType::uint16);
    Box const box{{2, 3, 1}, {9, 8, 7}};
    for (Axis axis : {Axis::x, Axis::y, Axis::z})
        for (std::int64_t slab : {1, 3, 8}) {
            Flip flip(axis, Roi{"2:9,3:8,1:7"});
            Volume const out = apply(flip, {in}, with(2, slab));
            for (std::int64_t z = 0; z < 8; ++z)
                for (std::int64_t y = 0; y < 10; ++y)
                    for (std::int64_t x = 0; x < 12; ++x) {
                        Index3 from{x, y, z};
                        int const a = static_cast<int>(axis);
                        if (box.contains({from, from + Index3{1, 1, 1}}))
                            from[a] = box.lower[a] + box.upper[a] - 1 - from[a];
                        ASSERT_TRUE(same_voxel(in.view(), from, out.view(), {x, y, z}));
                    }
            EXPECT_EQ(out.header().geometry, in.header().geometry);
        }
}

TEST(Flip, LargeRowsTakeTheStreamingPath) {
    Volume const in = bytes_volume({20011, 700, 2}, DataType::uint8); // 28 MB, odd rows
    Flip flip(Axis::x);
    Volume const out = apply(flip, {in}, with(2, 2));
    for (std::int64_t x : {0, 1, 63, 64, 8191, 8192, 20009, 20010})
        for (std::int64_t y : {0, 1, 350, 699})
            ASSERT_TRUE(same_voxel(in.view(), {20010 - x, y, 1}, out.view(), {x, y, 1}));
    EXPECT_TRUE(same_voxels(apply(flip, {out}, with(1, 2)), in));
}

TEST(Flip, PartsOfAWholeMoveWithIt) {
    Header header = header_of({4, 5, 6}, DataType::uint8);
    header.part = Part{{20, 5, 6}, {3, 0, 0}, {0, 0, 0}};
    Flip flip(Axis::x);
    EXPECT_EQ(flip.plan(std::vector<Header>{header}).output.part->offset, (Index3{13, 0, 0}));
}

TEST(Fill, SetsTheRegionAndNothingElse) {
    for (int t = 0; t < data_type_count; ++t) {
        Volume const in = noise_volume({13, 9, 7}, static_cast<DataType>(t), 1);
        Fill fill(42, Roi{"3:11,2:,1:6"});
        std::vector<double> const before = values_of(in), after = values_of(apply(fill, {in}, with(2, 2)));
        for (std::int64_t z = 0; z < 7; ++z)
            for (std::int64_t y = 0; y < 9; ++y)
                for (std::int64_t x = 0; x < 13; ++x) {
                    auto const i = static_cast<std::size_t>((z * 9 + y) * 13 + x);
                    bool const inside = x >= 3 && x < 11 && y >= 2 && z >= 1 && z < 6;
                    ASSERT_EQ(after[i], inside ? 42 : before[i]);
                }
        EXPECT_TRUE(fill.remarks().empty());
    }
}

TEST(Fill, LargeVolumesTakeTheStreamingPath) {
    Volume const in = noise_volume({1001, 301, 31}, DataType::float32, 1); // 37 MB
    Fill fill(2.5);
    for (double v : values_of(apply(fill, {in}, with(2, 31)))) ASSERT_EQ(v, 2.5);
}

TEST(Fill, SaysWhatDoesNotFit) {
    double const nan = std::numeric_limits<double>::quiet_NaN();
    for (auto [type, value, stored] :
         {std::tuple{DataType::uint8, 255.5, 255.0}, std::tuple{DataType::int16, -4e4, -32768.0},
          std::tuple{DataType::uint32, nan, 0.0}}) {
        Volume const in = noise_volume({4, 3, 2}, type, 1);
        Fill fill(value);
        EXPECT_EQ(values_of(apply(fill, {in}, with(1, 1))).front(), stored);
        ASSERT_EQ(fill.remarks().size(), 1u);
        EXPECT_TRUE(fill.remarks().front().lossy);
    }
}

TEST(Crop, TakesTheBoxAndMovesTheOrigin) {
    for (int t = 0; t < data_type_count; ++t) {
        Volume in = bytes_volume({13, 9, 7}, static_cast<DataType>(t));
        in.header().geometry.spacing = {0.5, 1, 2};
        Crop crop(Roi{"3:11,2:,1:6"});
        Volume const out = apply(crop, {in}, with(2, 2));
        ASSERT_EQ(out.header().dims, (Index3{8, 7, 5}));
        EXPECT_EQ(out.header().geometry.origin, (Vec3{1.5, 2, 2}));
        for (std::int64_t z = 0; z < 5; ++z)
            for (std::int64_t y = 0; y < 7; ++y)
                for (std::int64_t x = 0; x < 8; ++x)
                    ASSERT_TRUE(same_voxel(in.view(), {x + 3, y + 2, z + 1}, out.view(), {x, y, z}));
    }
}

TEST(Crop, OffsetsOfPartsAddUp) {
    Header header = header_of({10, 10, 10}, DataType::uint8);
    header.part = Part{{100, 100, 100}, {20, 30, 40}, {2, 2, 2}};
    Crop crop(Roi{"1:5,2:6,3:7"});
    Part const part = *crop.plan(std::vector<Header>{header}).output.part;
    EXPECT_EQ(part.offset, (Index3{21, 32, 43}));
    EXPECT_EQ(part.halo, (Index3{0, 0, 0}));
    EXPECT_EQ(part.global_dims, (Index3{100, 100, 100}));
}

// 2.2e9 voxels: more than 31 bits can count. Runs where there is memory for two of them.
TEST(Geometric, IndicesBeyond32Bits) {
    if (default_memory() * 4 < (std::size_t{12} << 30)) GTEST_SKIP() << "needs 12 GiB of memory";
    Index3 const dims{1300, 1300, 1300};
    Volume in(header_of(dims, DataType::uint8));
    AnyView const view = in.mutable_view();
    std::memset(view.data, 1, view.bytes());
    *view.at(1299, 1299, 1299) = std::byte{77};
    *view.at(0, 1299, 1299) = std::byte{55};
    Execution execution = with(2, 16);
    execution.memory = std::size_t{6} << 30;
    Crop corner(Roi{"1299:,1299:,1299:"});
    EXPECT_EQ(values_of(apply(corner, {in}, execution)), std::vector<double>{77});
    Flip flip(Axis::x);
    Volume const out = apply(flip, {in}, execution);
    EXPECT_EQ(*out.view().at(0, 1299, 1299), std::byte{77});
    EXPECT_EQ(*out.view().at(1299, 1299, 1299), std::byte{55});
    EXPECT_EQ(*out.view().at(1298, 1299, 1299), std::byte{1});
}

TEST(Beside, BoxesMakeUpWhatIsNotInside) {
    Box const whole{{-1, 2, 3}, {4, 6, 8}};
    for (Box const inside : {Box{{0, 3, 4}, {2, 5, 7}}, Box{{-1, 2, 3}, {4, 6, 8}}, Box{{-1, 2, 3}, {4, 6, 4}},
                             Box{{3, 5, 7}, {4, 6, 8}}, Box{{0, 3, 5}, {0, 5, 7}}}) {
        std::vector<int> times(static_cast<std::size_t>(whole.voxels()), 0);
        auto const count = [&](Box const& box) {
            for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
                for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                    for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
                        ++times[static_cast<std::size_t>(((z - 3) * 4 + y - 2) * 5 + x + 1)];
        };
        for_each_beside(whole, inside, count);
        count(inside);
        for (int const n : times) EXPECT_EQ(n, 1);
    }
}

TEST(CopyRegion, IsTheSameInAnyNumberOfThreads) {
    for (DataType const type : {DataType::uint8, DataType::uint16, DataType::float32, DataType::float64}) {
        Volume const from = bytes_volume({130, 90, 40}, type);
        for (Box const& box :
             {Box{{0, 0, 0}, {130, 90, 40}}, Box{{3, 5, 1}, {129, 88, 39}}, Box{{0, 7, 2}, {130, 60, 40}}})
            for (int const threads : {1, 2, 5}) {
                Volume to(header_of(box.dims(), type));
                copy_region(from.view().part(box), to.mutable_view(), with(threads, 0));
                for (std::int64_t z = 0; z < box.dims().z; ++z)
                    for (std::int64_t y = 0; y < box.dims().y; ++y)
                        EXPECT_EQ(std::memcmp(to.view().at(0, y, z),
                                              from.view().at(box.lower.x, box.lower.y + y, box.lower.z + z),
                                              static_cast<std::size_t>(box.dims().x) * size_of(type)),
                                  0);
            }
    }
}

} // namespace
} // namespace vkt
