// The transport through GPU memory without a GPU: a file in memory takes its place, and everything else is as it is.
// SPDX-License-Identifier: MIT
#include "file_gpu.h"
#include "ipc/channel.h"
#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/voxels/crop.h"
#include "pipes.h"

#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <thread>
#include <unistd.h>

namespace {

using namespace vkt;
using vkt::test::consume;
using vkt::test::expect_same;
using vkt::test::FileGpu;
using vkt::test::patterned;
using vkt::test::Pipe;

std::shared_ptr<FileGpu> a_gpu(unsigned char name = 1) { return std::make_shared<FileGpu>(name); }

struct Sent {
    std::string notice, way;
};

/// Writes volumes to a GPU and closes the pipe.
Sent produce(int descriptor, std::shared_ptr<ipc::GpuMemory> gpu, std::vector<Volume> const& volumes,
             std::int64_t slab = 4) {
    Sent sent;
    {
        ipc::StreamOptions options;
        options.transport = ipc::Transport::gpu;
        options.gpu = std::move(gpu);
        options.notice = [&](std::string const& message) { sent.notice += message; };
        ipc::StreamSink sink(descriptor, options);
        Execution execution;
        execution.slab = slab;
        drain(*volume_source(volumes), sink, execution);
        sent.way = sink.way();
    }
    ::close(descriptor);
    return sent;
}

std::unique_ptr<ipc::StreamSource> source_on(int descriptor, std::shared_ptr<ipc::GpuMemory> gpu) {
    ipc::StreamOptions options;
    options.gpu = std::move(gpu);
    return std::make_unique<ipc::StreamSource>(std::make_unique<ByteSource>(descriptor, "pipe"), options);
}

std::vector<Volume> consume_on(int descriptor, std::shared_ptr<ipc::GpuMemory> gpu) {
    return consume(*source_on(descriptor, std::move(gpu)));
}

/// Both ends of one pipe.
struct Hop {
    Sent sent;
    std::vector<Volume> read;
};
Hop hop(std::vector<Volume> const& volumes, std::shared_ptr<ipc::GpuMemory> from, std::shared_ptr<ipc::GpuMemory> to,
        std::int64_t slab = 4) {
    Pipe pipe;
    Hop result;
    std::jthread producer([&] { result.sent = produce(pipe.write_end, std::move(from), volumes, slab); });
    result.read = consume_on(pipe.read_end, std::move(to));
    producer.join();
    return result;
}

TEST(GpuTransport, VoxelsAreLeftInItsMemoryAndArriveUnchanged) {
    std::vector<Volume> const volumes{patterned({64, 64, 40}, 1), patterned({7, 5, 3}, 2), patterned({100, 90, 64}, 3)};
    for (std::int64_t slab : {1, 3, 64}) {
        auto const from = a_gpu(), to = a_gpu();
        Hop const got = hop(volumes, from, to, slab);
        EXPECT_EQ(got.sent.notice, "");
        EXPECT_EQ(got.sent.way, "GPU memory");
        expect_same(got.read, volumes);
        EXPECT_GT(from->pieces_made(), 0);
        EXPECT_EQ(to->pieces_opened(), from->pieces_made());
        EXPECT_EQ(from->pieces_alive() + to->pieces_alive(), 0);
    }
}

TEST(GpuTransport, ItHoldsFourSlabsHoweverLargeTheVolume) {
    auto const from = a_gpu(), to = a_gpu();
    std::vector<Volume> const volumes{patterned({64, 64, 1000}, 1)};
    expect_same(hop(volumes, from, to, 1).read, volumes);
    EXPECT_EQ(from->most_bytes(), 4u * 64 * 64 * 4);
    // Slabs are as large as suits the GPU, if nobody says otherwise.
    auto const other = a_gpu();
    expect_same(hop(volumes, other, to, 0).read, volumes);
    EXPECT_EQ(other->most_bytes(), 4 * other->slab_bytes());
}

TEST(GpuTransport, WorkIsSettledBeforeASlabIsNamedAndBeforeItIsReturned) {
    auto const from = a_gpu(), to = a_gpu();
    (void)hop({patterned({64, 64, 40}, 1)}, from, to, 4);
    EXPECT_GE(from->settled(), 10);
    EXPECT_GE(to->settled(), 10);
}

TEST(GpuTransport, WhatStandsInTheWayIsSaidOnceAndVoxelsArriveAllTheSame) {
    std::vector<Volume> const volumes{patterned({64, 64, 40}, 1), patterned({64, 64, 40}, 2)};
    auto const unable = a_gpu();
    unable->refuse_identity("GPU: the container forbids it");
    auto const full = a_gpu();
    full->refuse_pieces("GPU: cannot allocate memory to share: out of memory");
    struct Case {
        std::shared_ptr<ipc::GpuMemory> from, to;
        std::string said;
    };
    for (auto const& c : {Case{a_gpu(), nullptr, "the next stage reads no GPU memory"},
                          Case{a_gpu(1), a_gpu(2), "the next stage works on another GPU"},
                          Case{a_gpu(), unable, "the next stage cannot map memory of its GPU"},
                          Case{unable, a_gpu(), "GPU: the container forbids it"},
                          Case{full, a_gpu(), "GPU: cannot allocate memory to share: out of memory"}}) {
        Hop const got = hop(volumes, c.from, c.to);
        EXPECT_EQ(got.sent.notice, c.said + ": voxels go through shared memory");
        EXPECT_EQ(got.sent.way, "shared memory");
        expect_same(got.read, volumes);
    }
}

TEST(GpuTransport, AReaderThatIsNoVktGetsVoxelsThroughThePipe) {
    std::vector<Volume> const volumes{patterned({64, 64, 40}, 5)};
    Pipe first, second;
    Sent sent;
    std::jthread producer([&] { sent = produce(first.write_end, a_gpu(), volumes); });
    std::jthread between([&] { vkt::test::pass_bytes(first.read_end, second.write_end); });
    auto const read = consume_on(second.read_end, a_gpu());
    producer.join();
    between.join();
    expect_same(read, volumes);
    EXPECT_EQ(sent.notice, "the next stage does not share memory: voxels go through the pipe");
    EXPECT_EQ(sent.way, "pipe");
}

TEST(GpuTransport, OtherTransportsServeAReaderOnAGpu) {
    std::vector<Volume> const volumes{patterned({64, 64, 40}, 5)};
    for (auto const transport : {ipc::Transport::pipe, ipc::Transport::shm}) {
        Pipe pipe;
        std::string notice;
        std::jthread producer([&] { vkt::test::produce(pipe.write_end, transport, volumes, 4, &notice); });
        auto const read = consume_on(pipe.read_end, a_gpu());
        producer.join();
        expect_same(read, volumes);
        EXPECT_EQ(notice, "");
    }
}

/// A stage that changes no voxel.
Sent hand_through(int from, int to, std::shared_ptr<ipc::GpuMemory> gpu) {
    Sent sent;
    {
        Crop everything;
        std::vector<std::unique_ptr<Source>> inputs;
        inputs.push_back(source_on(from, gpu));
        auto const source = attach(std::move(inputs), everything, {}, {});
        ipc::StreamOptions options;
        options.transport = ipc::Transport::gpu;
        options.gpu = gpu;
        options.notice = [&](std::string const& message) { sent.notice += message; };
        ipc::StreamSink sink(to, options);
        drain(*source, sink, {});
        sent.way = sink.way();
    }
    ::close(to);
    return sent;
}

TEST(GpuTransport, AStageThatChangesNoVoxelPassesOnTheSlotsItWasGiven) {
    std::vector<Volume> const volumes{patterned({64, 64, 40}, 5), patterned({100, 90, 64}, 3)};
    Pipe first, second;
    auto const from = a_gpu(), middle = a_gpu(), to = a_gpu();
    std::jthread producer([&] { (void)produce(first.write_end, from, volumes); });
    std::jthread stage([&] { EXPECT_EQ(hand_through(first.read_end, second.write_end, middle).way, "GPU memory"); });
    auto const read = consume_on(second.read_end, to);
    producer.join();
    stage.join();
    expect_same(read, volumes);
    EXPECT_EQ(middle->pieces_made(), 0);
    EXPECT_EQ(to->pieces_opened(), from->pieces_made());
}

TEST(GpuTransport, SlotsAreNotPassedOnToWhomTheyAreOfNoUse) {
    std::vector<Volume> const volumes{patterned({64, 64, 40}, 5)};
    Pipe first, second;
    Sent sent;
    std::jthread producer([&] { (void)produce(first.write_end, a_gpu(), volumes); });
    std::jthread stage([&] { sent = hand_through(first.read_end, second.write_end, a_gpu()); });
    auto const read = consume_on(second.read_end, nullptr); // reads no GPU memory
    producer.join();
    stage.join();
    expect_same(read, volumes);
    EXPECT_EQ(sent.way, "shared memory");
}

TEST(GpuTransport, AReaderThatLeavesEndsItsWriterAndNothingStays) {
    std::signal(SIGPIPE, SIG_IGN);
    auto const from = a_gpu();
    Pipe pipe;
    std::jthread producer([&] {
        EXPECT_ANY_THROW((void)produce(pipe.write_end, from, {patterned({64, 64, 4000}, 7)}, 1));
    });
    {
        auto const source = source_on(pipe.read_end, a_gpu());
        ASSERT_TRUE(source->next_volume());
        source->expect(box_of(source->header().dims));
        EXPECT_TRUE(source->borrow({{0, 0, 0}, {64, 64, 1}}).has_value());
    }
    producer.join();
    ::close(pipe.write_end);
    EXPECT_EQ(from->pieces_alive(), 0);
}

TEST(GpuTransport, AReaderThatDiesBeforeItNamesItsGpuEndsItsWriter) {
    std::signal(SIGPIPE, SIG_IGN);
    Pipe pipe;
    std::jthread producer([&] {
        EXPECT_ANY_THROW((void)produce(pipe.write_end, a_gpu(), {patterned({64, 64, 40}, 7)}));
    });
    vkt::test::greet_and_leave(pipe.read_end, {0x314b5456, 0x474b5456}); // "I am on a GPU", and gone
    producer.join();
    ::close(pipe.read_end);
    ::close(pipe.write_end);
}

TEST(GpuTransport, AWriterThatIsDoneAndGoneHasLeftItsMemory) {
    for (bool const on_gpu : {false, true}) {
        Pipe pipe;
        auto const gpu = a_gpu();
        auto writer = std::make_unique<ipc::ProducerChannel>(pipe.write_end);
        ipc::ConsumerChannel reader(pipe.read_end, false, a_gpu());
        ASSERT_TRUE(writer->connected(std::chrono::seconds(10)));
        writer->share_ring(4, 4096, on_gpu ? gpu : nullptr);
        std::memset(writer->slot(ipc::slot_name(1, 2)), 7, 4096);
        writer.reset(); // it has not even read which GPU the reader works on
        EXPECT_EQ(reader.slot(ipc::slot_name(1, 2), 4096)[4095], std::byte{7});
        ::close(pipe.read_end);
        ::close(pipe.write_end);
    }
}

TEST(GpuTransport, VoxelsThatAreThereWithoutAnEndAreNoVolume) {
    Volume const volume = patterned({64, 64, 8}, 7);
    Pipe pipe;
    auto const from = a_gpu();
    std::jthread producer([&] {
        ipc::StreamOptions options;
        options.transport = ipc::Transport::gpu;
        options.gpu = from;
        ipc::StreamSink sink(pipe.write_end, options);
        sink.begin(volume.header());
        for (std::int64_t z = 0; z < 8; z += 4) { // all of them, but nobody says so
            AnyView const to = sink.acquire({{0, 0, z}, {64, 64, z + 4}});
            copy(volume.view().part(to.box), to);
            sink.commit();
        }
        ::close(pipe.write_end);
    });
    try {
        (void)consume_on(pipe.read_end, a_gpu());
        ADD_FAILURE() << "taken for whole";
    } catch (Error const& e) {
        EXPECT_EQ(e.kind(), ErrorKind::data);
        EXPECT_NE(std::string(e.what()).find("ended early"), std::string::npos) << e.what();
    }
    producer.join();
    EXPECT_EQ(from->pieces_alive(), 0);
}

TEST(GpuTransport, AnErrorUpstreamReachesTheReader) {
    Volume const volume = patterned({64, 64, 8}, 7);
    Pipe pipe;
    std::jthread producer([&] {
        ipc::StreamOptions options;
        options.transport = ipc::Transport::gpu;
        options.gpu = a_gpu();
        ipc::StreamSink sink(pipe.write_end, options);
        sink.begin(volume.header());
        AnyView const to = sink.acquire({{0, 0, 0}, {64, 64, 4}});
        copy(volume.view().part(to.box), to);
        sink.commit();
        sink.fail("vkt filter", "the GPU caught fire");
        ::close(pipe.write_end);
    });
    EXPECT_THROW((void)consume_on(pipe.read_end, a_gpu()), UpstreamError);
    producer.join();
}

/// A writer that shares a ring of four slots on a GPU and then names slabs of 4 slices as it pleases.
void write_slabs(int descriptor, std::vector<ipc::SlabHeader> const& slabs) {
    auto const write = [&](ipc::FrameType type, std::span<std::byte const> payload) {
        ipc::FrameHeader frame = ipc::sealed({type, ipc::flag_required, payload.size(), 0, 0});
        iovec parts[2]{{&frame, sizeof frame}, {const_cast<std::byte*>(payload.data()), payload.size()}};
        ipc::write_all(descriptor, parts);
    };
    ipc::ProducerChannel channel(descriptor);
    Header header;
    header.dims = {64, 64, 8};
    header.dtype = DataType::uint32;
    iovec start{const_cast<char*>(ipc::magic.data()), ipc::magic.size()};
    ipc::write_all(descriptor, std::span(&start, 1));
    std::string const json = to_json(header);
    write(ipc::FrameType::header, std::as_bytes(std::span(json)));
    ASSERT_TRUE(channel.connected(std::chrono::seconds(10)));
    auto const gpu = a_gpu();
    EXPECT_EQ(channel.gpu_obstacle(*gpu), "");
    channel.share_ring(4, 4 * 64 * 64 * 4, gpu);
    for (auto const& slab : slabs) write(ipc::FrameType::slab, std::as_bytes(std::span(&slab, 1)));
    ::close(descriptor);
}

TEST(GpuTransport, SlabsThatLieNowhereOrOutOfOrderAreRefused) {
    constexpr std::uint64_t bytes = 4 * 64 * 64 * 4;
    constexpr auto place = ipc::Residence::shared;
    struct Case {
        std::vector<ipc::SlabHeader> slabs;
        std::string said;
    };
    for (auto const& c : {Case{{{0, 4, place, ipc::slot_name(1, 4), bytes}}, "outside the shared memory"},
                          Case{{{0, 4, place, ipc::slot_name(2, 0), bytes}}, "ended before it shared its memory"},
                          Case{{{0, 4, place, 0, bytes}}, "not offered"},
                          Case{{{4, 8, place, ipc::slot_name(1, 0), bytes}}, "out of order"},
                          Case{{{0, 8, place, ipc::slot_name(1, 0), 2 * bytes}}, "outside the shared memory"},
                          Case{{{0, 4, place, ipc::slot_name(1, 0), bytes - 1}}, "of the wrong size"},
                          Case{{{0, 4, place, ipc::slot_name(1, 0), bytes}}, "ended early"},
                          Case{{{0, 4, place, ipc::slot_name(1, 0), bytes}, {0, 4, place, ipc::slot_name(1, 1), bytes}},
                               "out of order"}}) {
        Pipe pipe;
        std::jthread producer([&] { write_slabs(pipe.write_end, c.slabs); });
        try {
            (void)consume_on(pipe.read_end, a_gpu());
            ADD_FAILURE() << "not refused: " << c.said;
        } catch (Error const& e) {
            EXPECT_EQ(e.kind(), ErrorKind::data);
            EXPECT_NE(std::string(e.what()).find(c.said), std::string::npos) << c.said << ": " << e.what();
        }
    }
}

TEST(GpuTransport, MemoryThatIsNotWhatItClaimsToBeIsRefused) {
    int const small = ::memfd_create("test", 0);
    EXPECT_THROW((void)ipc::SharedRing::open(small, 4, 4096, a_gpu()), Error);
    EXPECT_EQ(::fcntl(small, F_GETFD), -1); // closed
    int const other = ::memfd_create("test", 0);
    EXPECT_THROW((void)ipc::SharedRing::open(other, 0, 4096, a_gpu()), Error);
    EXPECT_EQ(::fcntl(other, F_GETFD), -1);
}

TEST(GpuTransport, WithoutAGpuItIsRefused) {
    try {
        (void)ipc::cuda_memory(99, "--transport gpu");
        ADD_FAILURE() << "not refused";
    } catch (Error const& e) {
        EXPECT_EQ(e.kind(), ErrorKind::resources);
        EXPECT_EQ(std::string(e.what()).find("--transport gpu: "), 0u) << e.what();
    }
}

} // namespace
