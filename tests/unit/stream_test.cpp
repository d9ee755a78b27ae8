// The stream: round trips, several volumes, and every way in which one can be cut, damaged or out of order.
// SPDX-License-Identifier: MIT
#include "ipc/frame.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"

#include <cstring>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

namespace {

using namespace vkt;

Header small_header(Index3 dims = {7, 5, 6}) {
    Header header;
    header.dims = dims;
    header.dtype = DataType::uint16;
    header.geometry.spacing = {0.5, 2, 3};
    header.attributes["key"] = "value";
    header.history = History{{"make", "noise"}, {}};
    return header;
}

Volume counting_volume(Header const& header) {
    Volume volume(header);
    auto const view = volume.mutable_view();
    auto* voxels = reinterpret_cast<std::uint16_t*>(view.data);
    for (std::int64_t i = 0; i < header.voxels(); ++i) voxels[i] = static_cast<std::uint16_t>(i * 7919);
    return volume;
}

class MemoryFile {
public:
    MemoryFile() : descriptor_(::memfd_create("test", 0)) {}
    ~MemoryFile() { ::close(descriptor_); }
    int descriptor() const { return descriptor_; }
    std::string contents() const {
        std::string bytes(static_cast<std::size_t>(::lseek(descriptor_, 0, SEEK_END)), 0);
        EXPECT_EQ(::pread(descriptor_, bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
        return bytes;
    }

private:
    int descriptor_;
};

std::string stream_of(std::vector<Volume> const& volumes, std::int64_t slab, bool checksum = true) {
    MemoryFile file;
    ipc::StreamOptions options;
    options.checksum = checksum;
    ipc::StreamSink sink(file.descriptor(), options);
    Execution execution;
    execution.slab = slab;
    auto const source = volume_source(volumes);
    drain(*source, sink, execution);
    return file.contents();
}

std::unique_ptr<ipc::StreamSource> source_of(std::string const& bytes) {
    int const descriptor = ::memfd_create("test", 0);
    EXPECT_EQ(::write(descriptor, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    ::lseek(descriptor, 0, SEEK_SET);
    return std::make_unique<ipc::StreamSource>(std::make_unique<ByteSource>(descriptor, "test"), ipc::StreamOptions{});
}

/// The same through a pipe, which has room for them.
std::unique_ptr<ipc::StreamSource> piped_source_of(std::string const& bytes) {
    int ends[2]{-1, -1};
    EXPECT_EQ(::pipe(ends), 0);
    EXPECT_EQ(::write(ends[1], bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    ::close(ends[1]);
    return std::make_unique<ipc::StreamSource>(std::make_unique<ByteSource>(ends[0], "test"), ipc::StreamOptions{});
}

std::vector<Volume> read_all(std::string const& bytes) {
    auto const source = source_of(bytes);
    std::vector<Volume> volumes;
    while (source->next_volume()) volumes.push_back(load(*source, {}));
    return volumes;
}

bool same_voxels(Volume const& a, Volume const& b) {
    return a.header() == b.header() && std::memcmp(a.view().data, b.view().data, a.header().bytes()) == 0;
}

TEST(Stream, RoundTripsForEverySlabHeight) {
    Volume const volume = counting_volume(small_header());
    for (std::int64_t slab : {1, 2, 4, 6}) {
        auto const read = read_all(stream_of({volume}, slab));
        ASSERT_EQ(read.size(), 1u);
        EXPECT_TRUE(same_voxels(read.front(), volume)) << slab;
    }
}

TEST(Stream, HoldsSeveralVolumes) {
    Volume const a = counting_volume(small_header());
    Volume const b = counting_volume(small_header({3, 4, 2}));
    auto const read = read_all(stream_of({a, b, a}, 2));
    ASSERT_EQ(read.size(), 3u);
    EXPECT_TRUE(same_voxels(read[1], b));
    EXPECT_TRUE(same_voxels(read[2], a));
}

TEST(Stream, JoinsByConcatenation) {
    Volume const a = counting_volume(small_header());
    EXPECT_EQ(read_all(stream_of({a}, 2) + stream_of({a}, 3)).size(), 2u);
}

TEST(Stream, TruncationIsAnErrorAtEveryByte) {
    std::string const whole = stream_of({counting_volume(small_header({3, 2, 4}))}, 2);
    for (std::size_t n = 0; n < whole.size(); ++n) {
        try {
            read_all(whole.substr(0, n));
            FAIL() << "cut at " << n << " of " << whole.size() << " passed for whole";
        } catch (Error const& e) {
            EXPECT_EQ(e.kind(), ErrorKind::data);
        }
    }
}

TEST(Stream, DamageOfAnyByteIsNoticedOrHarmless) {
    Volume const volume = counting_volume(small_header({3, 2, 4}));
    std::string const whole = stream_of({volume}, 2);
    for (std::size_t n = 0; n < whole.size(); ++n) {
        std::string damaged = whole;
        damaged[n] = static_cast<char>(damaged[n] ^ 0x41);
        try {
            auto const read = read_all(damaged);
            ASSERT_EQ(read.size(), 1u);
            EXPECT_TRUE(same_voxels(read.front(), volume)) << "byte " << n;
        } catch (Error const& e) {
            EXPECT_TRUE(e.kind() == ErrorKind::data) << "byte " << n << ": " << e.what();
        }
    }
}

TEST(Stream, WithoutChecksumsLengthsStillCount) {
    std::string const whole = stream_of({counting_volume(small_header())}, 2, false);
    EXPECT_EQ(read_all(whole).size(), 1u);
    EXPECT_THROW(read_all(whole.substr(0, whole.size() - 60)), Error);
}

/// Of a command that failed within a volume.
std::string broken_stream() {
    MemoryFile file;
    ipc::StreamSink sink(file.descriptor(), {});
    sink.begin(small_header());
    sink.fail("vkt crop", "it broke");
    return file.contents();
}

TEST(Stream, ErrorFrameCarriesTheOrigin) {
    auto const source = piped_source_of(broken_stream());
    ASSERT_TRUE(source->next_volume());
    try {
        load(*source, {});
        FAIL();
    } catch (UpstreamError const& e) {
        EXPECT_STREQ(e.what(), "vkt crop: it broke");
    }
}

TEST(Stream, ErrorBeforeTheFirstVolume) {
    MemoryFile file;
    ipc::StreamSink sink(file.descriptor(), {});
    sink.fail("vkt read", "no such file");
    EXPECT_THROW(piped_source_of(file.contents())->next_volume(), UpstreamError);
}

TEST(Stream, ErrorFrameOfAFileIsSaidByWhoReadsIt) {
    auto const source = source_of(broken_stream());
    ASSERT_TRUE(source->next_volume());
    try {
        load(*source, {});
        FAIL();
    } catch (UpstreamError const&) {
        FAIL() << "nobody else is there to say it";
    } catch (Error const& e) {
        EXPECT_EQ(e.kind(), ErrorKind::data);
        EXPECT_NE(std::string(e.what()).find("vkt crop: it broke"), std::string::npos);
    }
}

TEST(Stream, SkipsWhatNobodyExpects) {
    Volume const volume = counting_volume(small_header({4, 3, 9}));
    auto const source = source_of(stream_of({volume}, 1));
    ASSERT_TRUE(source->next_volume());
    Box const wanted{{0, 0, 3}, {4, 3, 5}};
    source->expect(wanted);
    std::vector<std::uint16_t> voxels(4 * 3 * 2);
    source->read(dense_view(reinterpret_cast<std::byte*>(voxels.data()), DataType::uint16, wanted));
    source->finish();
    EXPECT_EQ(voxels.front(), static_cast<std::uint16_t>(36 * 7919));
    EXPECT_FALSE(source->next_volume());
}

/// A stream of one volume whose slabs are these boxes, each whole in x.
std::string stream_of_pieces(Volume const& volume, std::vector<Box> const& pieces) {
    MemoryFile file;
    ipc::StreamSink sink(file.descriptor(), {});
    sink.begin(volume.header());
    for (Box const& piece : pieces) {
        copy(volume.view().part(piece), sink.acquire(piece));
        sink.commit();
    }
    sink.end();
    return file.contents();
}

TEST(Stream, SlicesMayComeAsRows) {
    Volume const volume = counting_volume(small_header({7, 5, 3}));
    std::vector<Box> const pieces{{{0, 0, 0}, {7, 2, 1}},
                                  {{0, 2, 0}, {7, 5, 1}},
                                  {{0, 0, 1}, {7, 5, 2}},
                                  {{0, 0, 2}, {7, 4, 3}},
                                  {{0, 4, 2}, {7, 5, 3}}};
    std::string const whole = stream_of_pieces(volume, pieces);
    auto const read = read_all(whole);
    ASSERT_EQ(read.size(), 1u);
    EXPECT_TRUE(same_voxels(read.front(), volume));
    for (std::size_t n = 0; n < whole.size(); n += 5) EXPECT_THROW(read_all(whole.substr(0, n)), Error) << n;
    // Some rows of every slice, in order.
    auto const source = source_of(whole);
    ASSERT_TRUE(source->next_volume());
    std::vector<std::uint16_t> voxels(7 * 3 * 3);
    Box const wanted{{0, 1, 0}, {7, 4, 3}};
    source->read(dense_view(reinterpret_cast<std::byte*>(voxels.data()), DataType::uint16, wanted));
    source->finish();
    EXPECT_EQ(voxels[7 * 3 + 2], static_cast<std::uint16_t>((7 * 5 + 7 + 2) * 7919));
}

TEST(Stream, RowsOutOfOrderAreRefused) {
    Volume const volume = counting_volume(small_header({7, 5, 2}));
    std::vector<std::vector<Box>> const wrong{
        {{{0, 0, 0}, {7, 2, 1}}, {{0, 3, 0}, {7, 5, 1}}, {{0, 0, 1}, {7, 5, 2}}}, // a row is missing
        {{{0, 0, 0}, {7, 3, 1}}, {{0, 2, 0}, {7, 5, 1}}, {{0, 0, 1}, {7, 5, 2}}}, // one comes twice
        {{{0, 0, 0}, {7, 2, 1}}, {{0, 0, 1}, {7, 5, 2}}},                         // the slice is not complete
        {{{0, 0, 0}, {7, 2, 2}}, {{0, 2, 0}, {7, 5, 2}}},                         // rows of two slices
        {{{0, 0, 0}, {7, 5, 1}}, {{0, 0, 1}, {7, 4, 2}}},                         // the last row is missing
    };
    for (std::size_t i = 0; i < wrong.size(); ++i) {
        try {
            read_all(stream_of_pieces(volume, wrong[i]));
            FAIL() << i;
        } catch (Error const& e) {
            EXPECT_EQ(e.kind(), ErrorKind::data) << i;
        }
    }
}

TEST(Stream, UnknownOptionalFramesAreSkippedRequiredOnesRefused) {
    std::string const whole = stream_of({counting_volume(small_header({2, 2, 2}))}, 2);
    std::size_t const first = whole.find("SLAB");
    for (bool required : {false, true}) {
        ipc::FrameHeader frame;
        frame.type = static_cast<ipc::FrameType>(0x58585858);
        frame.flags = required ? ipc::flag_required : 0;
        frame.length = 5;
        frame = ipc::sealed(frame);
        std::string extra(reinterpret_cast<char const*>(&frame), sizeof frame);
        extra += "hello";
        std::string const stream = whole.substr(0, first) + extra + whole.substr(first);
        if (required)
            EXPECT_THROW(read_all(stream), Error);
        else
            EXPECT_EQ(read_all(stream).size(), 1u);
    }
}

TEST(Stream, AbsurdHeadersAreRefusedWithoutAllocating) {
    for (Index3 dims : {Index3{std::int64_t{1} << 40, std::int64_t{1} << 40, 8}, Index3{0, 1, 1}, Index3{-4, 2, 2}}) {
        Header header = small_header();
        header.dims = dims;
        EXPECT_THROW(header_from_json(to_json(header)), Error);
    }
    std::string nan = to_json(small_header());
    nan.replace(nan.find("0.5"), 3, "1e999");
    EXPECT_THROW(header_from_json(nan), Error);
    EXPECT_THROW(header_from_json(std::string(100000, '[')), Error);
}

void expect_round_trip(Volume volume) {
    auto* cells = reinterpret_cast<std::uint16_t*>(volume.buffer().write(Space::host));
    for (std::int64_t i = 0; i < volume.header().cell_count; ++i) cells[i] = static_cast<std::uint16_t>(i);
    MemoryFile file;
    ipc::StreamSink sink(file.descriptor(), {});
    sink.begin(volume.header());
    sink.put_bricks(volume);
    sink.end();
    sink.close();
    auto const source = source_of(file.contents());
    ASSERT_TRUE(source->next_volume());
    Volume const read = source->take_bricks().whole();
    source->finish();
    EXPECT_EQ(read.bricks(), volume.bricks());
    EXPECT_EQ(std::memcmp(read.buffer().read(Space::host), cells, volume.header().bytes()), 0);
    std::string const whole = file.contents();
    for (std::size_t n = 0; n < whole.size(); n += 3) {
        EXPECT_THROW(
            {
                auto const cut = source_of(whole.substr(0, n));
                if (cut->next_volume()) {
                    cut->take_bricks().whole();
                    cut->finish();
                }
            },
            Error);
    }
}

TEST(Stream, HierarchicalVolumesRoundTrip) {
    // Packed, and bricks that have no common block.
    std::vector<Brick> const packed{{{0, 0, 0}, {4, 4, 2}, 0}, {{4, 0, 0}, {2, 4, 2}, 1}},
        odd{{{0, 0, 0}, {3, 4, 2}, 0}, {{4, 4, 0}, {4, 2, 2}, 0}, {{3, 0, 0}, {1, 1, 1}, 0}};
    EXPECT_FALSE(Volume(small_header({8, 8, 4}), packed).bricks().words().empty());
    EXPECT_TRUE(Volume(small_header({8, 8, 4}), odd).bricks().words().empty());
    expect_round_trip(Volume(small_header({8, 8, 4}), packed));
    expect_round_trip(Volume(small_header({8, 8, 4}), odd));
}

} // namespace
