// Two ends of one pipe: voxels arrive the same through the pipe, through mapped pages and through shared memory.
// SPDX-License-Identifier: MIT
#include "ipc/channel.h"
#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/region_source.h"
#include "libvkt/operations/voxels/crop.h"
#include "pipes.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <thread>
#include <unistd.h>

namespace {

using namespace vkt;

using vkt::test::expect_same;
using vkt::test::patterned;
using vkt::test::Pipe;
using vkt::test::produce;

std::unique_ptr<ipc::StreamSource> source_of(int descriptor, bool whole = false) {
    ipc::StreamOptions options;
    options.whole = whole;
    return std::make_unique<ipc::StreamSource>(std::make_unique<ByteSource>(descriptor, "pipe"), options);
}

std::vector<Volume> consume(int descriptor, bool whole = false) {
    return vkt::test::consume(*source_of(descriptor, whole));
}

class Transports : public testing::TestWithParam<ipc::Transport> {};

TEST_P(Transports, VoxelsArriveUnchanged) {
    // Slabs below and above the size from which pages are mapped, many more of them than there are buffers.
    std::vector<Volume> const volumes{patterned({256, 256, 40}, 1), patterned({7, 5, 3}, 2),
                                      patterned({300, 200, 64}, 3)};
    for (std::int64_t slab : {1, 3, 8, 64}) {
        Pipe pipe;
        std::string notice;
        std::thread producer([&] { produce(pipe.write_end, GetParam(), volumes, slab, &notice); });
        auto const read = consume(pipe.read_end);
        producer.join();
        expect_same(read, volumes);
        EXPECT_EQ(notice, "");
    }
}

TEST_P(Transports, SlabsMayBeAskedForTheirHeightAtAnyTime) {
    std::vector<Volume> const volumes{patterned({64, 32, 20}, 1), patterned({64, 32, 3}, 2)};
    for (std::int64_t slab : {4, 64}) {
        Pipe pipe;
        std::string notice;
        std::thread producer([&] { produce(pipe.write_end, GetParam(), volumes, slab, &notice); });
        auto const source = source_of(pipe.read_end);
        for (Volume const& volume : volumes) {
            ASSERT_TRUE(source->next_volume());
            std::int64_t const height = source->natural_slab();
            EXPECT_EQ(height, std::min(slab, volume.header().dims.z));
            Volume read(source->header());
            for (std::int64_t z = 0; z < volume.header().dims.z; ++z) {
                Box slice = box_of(volume.header().dims);
                slice.lower.z = z;
                slice.upper.z = z + 1;
                source->read(read.mutable_view().part(slice));
                std::int64_t const again = source->natural_slab();
                EXPECT_TRUE(again == height || again == 0) << again;
            }
            source->finish();
        }
        EXPECT_FALSE(source->next_volume());
        producer.join();
    }
}

TEST_P(Transports, AThirdPartyInBetweenKeepsVoxelsInThePipe) {
    std::vector<Volume> const volumes{patterned({256, 256, 40}, 5)};
    Pipe first, second;
    std::string notice;
    std::thread producer([&] { produce(first.write_end, GetParam(), volumes, 8, &notice); });
    std::thread between([&] { vkt::test::pass_bytes(first.read_end, second.write_end); });
    auto const read = consume(second.read_end);
    producer.join();
    between.join();
    expect_same(read, volumes);
    EXPECT_EQ(notice.empty(), GetParam() == ipc::Transport::pipe) << notice;
}

TEST_P(Transports, UnwantedSlabsAreReturned) {
    Volume const volume = patterned({256, 256, 64}, 9);
    Pipe pipe;
    std::string notice;
    std::thread producer([&] { produce(pipe.write_end, GetParam(), {volume}, 4, &notice); });
    {
        ipc::StreamSource source(std::make_unique<ByteSource>(pipe.read_end, "pipe"), {});
        ASSERT_TRUE(source.next_volume());
        Box const part{{10, 20, 30}, {200, 100, 33}};
        source.expect(part);
        Header header = source.header();
        header.dims = part.dims();
        Volume got(header);
        source.read(got.mutable_view().moved_to(part.lower));
        source.finish();
        auto const a = volume.view().as<std::uint32_t>();
        auto const b = got.view().as<std::uint32_t>();
        EXPECT_EQ(a(10, 20, 30), b(0, 0, 0));
        EXPECT_EQ(a(199, 99, 32), b(189, 79, 2));
    }
    producer.join();
}

/// A stage that changes no voxel: its slabs may stay where they lie.
void hand_through(int from, int to, ipc::Transport transport) {
    {
        Crop everything;
        std::vector<std::unique_ptr<Source>> inputs;
        inputs.push_back(source_of(from));
        auto const source = attach(std::move(inputs), everything, {}, {});
        ipc::StreamOptions options;
        options.transport = transport;
        ipc::StreamSink sink(to, options);
        drain(*source, sink, {});
    }
    ::close(to);
}

TEST_P(Transports, VoxelsArriveUnchangedThroughStagesThatChangeNone) {
    // The last volume has larger slabs than the first: its producer makes another ring.
    std::vector<Volume> const volumes{patterned({64, 64, 200}, 1), patterned({7, 5, 3}, 2),
                                      patterned({300, 200, 64}, 3)};
    for (std::int64_t slab : {1, 3, 64}) {
        Pipe first, second, third;
        std::string notice;
        std::thread producer([&] { produce(first.write_end, GetParam(), volumes, slab, &notice); });
        std::thread stage([&] { hand_through(first.read_end, second.write_end, GetParam()); });
        std::thread next([&] { hand_through(second.read_end, third.write_end, GetParam()); });
        auto const read = consume(third.read_end);
        producer.join();
        stage.join();
        next.join();
        expect_same(read, volumes);
    }
}

TEST_P(Transports, SlabsStayUntilTheLastStageHasSeenThem) {
    Volume const volume = patterned({64, 64, 64}, 7);
    Pipe first, second;
    std::string notice;
    std::thread producer([&] { produce(first.write_end, GetParam(), {volume}, 1, &notice); });
    std::thread stage([&] { hand_through(first.read_end, second.write_end, GetParam()); });
    {
        ipc::StreamSource source(std::make_unique<ByteSource>(second.read_end, "pipe"), {});
        ASSERT_TRUE(source.next_volume());
        source.expect(box_of(volume.header().dims));
        for (std::int64_t z = 0; z < 64; ++z) {
            auto const slab = source.borrow({{0, 0, z}, {64, 64, z + 1}});
            ASSERT_TRUE(slab.has_value());
            // Whoever would write here too early has the time to.
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            auto const a = slab->as<std::uint32_t>();
            auto const b = volume.view().as<std::uint32_t>();
            for (std::int64_t y = 0; y < 64; ++y)
                for (std::int64_t x = 0; x < 64; ++x) ASSERT_EQ(a(x, y, z), b(x, y, z));
        }
        source.finish();
    }
    producer.join();
    stage.join();
}

TEST(SharedMemory, AStageThatChangesNoVoxelPassesOnTheSlotsItWasGiven) {
    Volume const volume = patterned({64, 64, 16}, 7);
    Pipe first, second;
    std::string notice;
    std::thread producer([&] { produce(first.write_end, ipc::Transport::shm, {volume}, 4, &notice); });
    std::thread consumer([&] { expect_same(consume(second.read_end), {volume}); });
    {
        ipc::StreamSource source(std::make_unique<ByteSource>(first.read_end, "pipe"), {});
        ipc::StreamOptions options;
        options.transport = ipc::Transport::shm;
        ipc::StreamSink sink(second.write_end, options);
        ASSERT_TRUE(source.next_volume());
        sink.begin(source.header());
        for (std::int64_t z = 0; z < 16; z += 4) {
            Box const slab{{0, 0, z}, {64, 64, z + 4}};
            auto const lease = source.lease(slab);
            ASSERT_NE(lease, nullptr);
            EXPECT_EQ(source.lease({{0, 0, z}, {64, 64, z + 3}}), nullptr); // only whole slabs
            EXPECT_TRUE(sink.pass_on(slab, lease));
        }
        source.finish();
        sink.end();
        sink.close();
    }
    ::close(second.write_end);
    producer.join();
    consumer.join();
}

TEST(SharedMemory, AConsumerThatLeavesReleasesWhatWasPassedOnToIt) {
    std::signal(SIGPIPE, SIG_IGN);
    Volume const volume = patterned({64, 64, 256}, 7);
    Pipe first, second;
    std::string notice;
    // All three stages end, though the last one held slots of the first and never gave them back.
    std::thread producer(
        [&] { EXPECT_ANY_THROW(produce(first.write_end, ipc::Transport::shm, {volume}, 1, &notice)); });
    std::thread stage([&] { EXPECT_ANY_THROW(hand_through(first.read_end, second.write_end, ipc::Transport::shm)); });
    {
        ipc::StreamSource source(std::make_unique<ByteSource>(second.read_end, "pipe"), {});
        ASSERT_TRUE(source.next_volume());
        source.expect(box_of(volume.header().dims));
        EXPECT_TRUE(source.borrow({{0, 0, 0}, {64, 64, 1}}).has_value());
    }
    stage.join();
    producer.join();
    ::close(first.write_end);
    ::close(second.write_end);
}

TEST_P(Transports, WholeVolumesArriveUnchangedAndOutliveTheStream) {
    std::vector<Volume> const volumes{patterned({256, 256, 40}, 1), patterned({7, 5, 3}, 2)};
    for (std::int64_t slab : {1, 7, 64}) {
        Pipe pipe;
        std::string notice;
        std::thread producer([&] { produce(pipe.write_end, GetParam(), volumes, slab, &notice); });
        auto const read = consume(pipe.read_end, true);
        producer.join();
        expect_same(read, volumes);
        EXPECT_EQ(notice, "");
    }
}

TEST_P(Transports, WhoeverWantsWholeVolumesMayStillReadRegions) {
    Volume const volume = patterned({64, 64, 32}, 9);
    Pipe pipe;
    std::string notice;
    std::thread producer([&] { produce(pipe.write_end, GetParam(), {volume, volume}, 4, &notice); });
    {
        ipc::StreamOptions options;
        options.whole = true;
        ipc::StreamSource source(std::make_unique<ByteSource>(pipe.read_end, "pipe"), options);
        ASSERT_TRUE(source.next_volume());
        source.expect(box_of(volume.header().dims));
        Volume got(volume.header());
        for (std::int64_t z = 0; z < 32; z += 8) {
            Box const part{{0, 0, z}, {64, 64, z + 8}};
            source.read(got.mutable_view().part(part));
        }
        source.finish();
        expect_same({got}, {volume});
        ASSERT_TRUE(source.next_volume());
        Volume changed = load(source, {});
        // The segment is the reader's own now: what it writes there nobody else sees, and nothing faults.
        std::memset(changed.mutable_view().data, 0, changed.header().bytes());
    }
    producer.join();
}

TEST(SharedMemory, AWholeVolumeIsTakenWithoutACopyOnce) {
    Volume const volume = patterned({64, 64, 32}, 3);
    Pipe pipe;
    std::string notice;
    std::thread producer([&] { produce(pipe.write_end, ipc::Transport::shm, {volume}, 4, &notice); });
    auto const source = source_of(pipe.read_end, true);
    ASSERT_TRUE(source->next_volume());
    auto const taken = source->take_whole();
    producer.join();
    ASSERT_TRUE(taken.has_value());
    expect_same({*taken}, {volume});
}

TEST_P(Transports, TreesArriveUnchanged) {
    // The second brick fills more than a frame of many bricks holds, and more than the first slots.
    Header header;
    header.dims = {256, 256, 256};
    header.dtype = DataType::uint32;
    std::vector<Brick> bricks;
    for (std::int64_t z = 0; z < 128; z += 8)
        for (std::int64_t x = 0; x < 256; x += 8) bricks.push_back({{x, 0, z}, {8, 8, 8}, 0});
    bricks.push_back({{0, 0, 128}, {256, 256, 32}, 0});
    std::vector<Volume> trees{Volume(header, bricks), Volume(header, {bricks.front()})};
    for (auto& tree : trees) {
        auto* cells = reinterpret_cast<std::uint32_t*>(tree.buffer().write(Space::host));
        for (std::int64_t i = 0; i < tree.header().cell_count; ++i) cells[i] = static_cast<std::uint32_t>(i) * 7919u;
    }
    for (bool const whole : {false, true}) {
        Pipe pipe;
        std::string notice;
        std::thread producer([&] { produce(pipe.write_end, GetParam(), trees, 0, &notice); });
        auto const read = consume(pipe.read_end, whole);
        producer.join();
        EXPECT_EQ(notice, "");
        ASSERT_EQ(read.size(), trees.size());
        for (std::size_t i = 0; i < trees.size(); ++i) {
            EXPECT_EQ(read[i].bricks(), trees[i].bricks());
            EXPECT_EQ(std::memcmp(const_cast<Volume&>(read[i]).buffer().read(Space::host),
                                  trees[i].buffer().read(Space::host), trees[i].header().bytes()),
                      0);
        }
    }
}

TEST(SharedMemory, ARegionIsNotTakenForTheWholeVolume) {
    Volume const volume = patterned({64, 64, 32}, 3);
    Pipe pipe;
    std::string notice;
    std::thread producer([&] { produce(pipe.write_end, ipc::Transport::shm, {volume}, 4, &notice); });
    auto const region = region_of(source_of(pipe.read_end, true), Roi{"8:16,:,4:20"}, {}, {});
    ASSERT_TRUE(region->next_volume());
    Volume const part = load(*region, {});
    producer.join();
    EXPECT_EQ(part.header().dims, (Index3{8, 64, 16}));
    EXPECT_EQ(part.view().as<std::uint32_t>()(7, 63, 15), volume.view().as<std::uint32_t>()(15, 63, 19));
}

INSTANTIATE_TEST_SUITE_P(Stream, Transports, testing::Values(ipc::Transport::pipe, ipc::Transport::shm));

TEST(SharedRing, RefusesWhatItIsNot) {
    int const small = ::memfd_create("test", MFD_ALLOW_SEALING);
    EXPECT_THROW(ipc::SharedRing::open(small, 4, 4096), Error); // neither long enough nor sealed
    EXPECT_THROW(ipc::SharedRing::create(4, std::size_t{1} << 50), Error);
}

} // namespace
