// Raw files: names, sizes, regions, byte order, pipes; byte sources and output files underneath.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/raw_name.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/io/temporaries.h"
#include "tests/unit/format_testing.h"

#include <cstring>
#include <thread>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>

namespace vkt::testing {
namespace {

std::string text_of(Bytes const& bytes) { return {reinterpret_cast<char const*>(bytes.data()), bytes.size()}; }

ReadOptions raw_options(Index3 dims, DataType type) {
    ReadOptions options;
    options.dims = dims;
    options.dtype = type;
    return options;
}

TEST(ByteSource, ThreadsShareLargeReadsOfLargeFiles) {
    ::setenv("VKT_THREADS", "16", 1);
    Scratch const scratch;
    std::string contents((std::size_t{20} << 20) + 12345, '\0');
    std::mt19937 random(1);
    for (std::size_t i = 0; i + 4 <= contents.size(); i += 4) {
        auto const word = static_cast<std::uint32_t>(random());
        std::memcpy(contents.data() + i, &word, 4);
    }
    put_file(scratch / "large", contents);
    auto const bytes = open_bytes(scratch / "large");
    ::unsetenv("VKT_THREADS");
    for (std::size_t n : {contents.size() - 1, std::size_t{1} << 20, (std::size_t{1} << 19) + 1, std::size_t{4095}}) {
        std::string read(n, '\0');
        bytes->read_at(1, read.data(), n);
        EXPECT_TRUE(contents.compare(1, n, read) == 0) << n;
    }
    // One who cuts the file meanwhile is told how much of it there was.
    ::truncate((scratch / "large").c_str(), 19 << 20);
    std::string read(std::size_t{4} << 20, '\0');
    auto const cut = caught([&] { bytes->read_at(std::int64_t{16} << 20, read.data(), read.size()); });
    EXPECT_EQ(cut.kind, ErrorKind::data);
    EXPECT_NE(cut.message.find(text("20971520 bytes needed, ", 19 << 20, " there")), std::string::npos) << cut.message;
}

TEST(RawName, FindsDimsAndType) {
    auto const a = parse_raw_name("/data/64x64x64/engine_256x200x128_uint8.raw");
    EXPECT_EQ(a.dims, (Index3{256, 200, 128}));
    EXPECT_EQ(a.dtype, DataType::uint8);
    auto const b = parse_raw_name("magnetic_reconnection_512x512x512_float32.raw");
    EXPECT_EQ(b.dtype, DataType::float32);
    EXPECT_EQ(parse_raw_name("a_7x5x3_int16.raw").dtype, DataType::int16);
    EXPECT_EQ(parse_raw_name("a_7x5x3_FLOAT64.raw.gz").dtype, DataType::float64);
    auto const none = parse_raw_name("a_7x5x3x2_0x1x1_99999999999999999999x1x1_int9.raw");
    EXPECT_FALSE(none.dims);
    EXPECT_FALSE(none.dtype);
}

TEST(Raw, RegionsOfRandomAndForwardSources) {
    Index3 const dims{70, 9, 11};
    for (DataType type : {DataType::uint8, DataType::uint16, DataType::float32, DataType::float64}) {
        Bytes const whole = noise(static_cast<std::size_t>(dims.x * dims.y * dims.z) * size_of(type), 1);
        auto const options = raw_options(dims, type);
        auto const file = [&] { return open_volume(memory_file(text_of(whole)), options); };
        auto const pipe = [&] { return open_volume(pipe_file(text_of(whole)), options); };
        EXPECT_EQ(file()->access(), Access::random);
        EXPECT_EQ(pipe()->access(), Access::forward);
        expect_regions(file, whole);
        expect_regions(pipe, whole);
    }
    // Rows so long that they are read one by one.
    Index3 const wide{5000, 4, 3};
    Bytes const whole = noise(60000 * 2, 2);
    expect_regions([&] { return open_volume(memory_file(text_of(whole)), raw_options(wide, DataType::int16)); }, whole);
}

TEST(Raw, PaddedOutputViews) {
    Index3 const dims{6, 5, 4};
    Bytes const whole = noise(120, 3);
    auto const source = open_volume(memory_file(text_of(whole)), raw_options(dims, DataType::uint8));
    ASSERT_TRUE(source->next_volume());
    Bytes room(8 * 7 * 4, std::byte{0xee});
    AnyView out{room.data(), DataType::uint8, box_of(dims), 8, 56, Space::host};
    source->read(out);
    for (std::int64_t z = 0; z < 4; ++z)
        for (std::int64_t y = 0; y < 7; ++y)
            for (std::int64_t x = 0; x < 8; ++x) {
                std::byte const expected =
                    x < 6 && y < 5 ? whole[static_cast<std::size_t>(x + 6 * (y + 5 * z))] : std::byte{0xee};
                EXPECT_EQ(room[static_cast<std::size_t>(x + 8 * (y + 7 * z))], expected);
            }
}

TEST(Raw, SkipAndByteOrder) {
    Index3 const dims{3, 2, 2};
    std::string const contents = "HEADER" + std::string("\x01\x02\x03\x04", 4) + std::string(20, '\0');
    ReadOptions options = raw_options(dims, DataType::uint16);
    options.skip = 6;
    options.big_endian = true;
    options.spacing = Vec3{0.5, 1, 2};
    auto const source = open_volume(memory_file(contents), options);
    ASSERT_TRUE(source->next_volume());
    EXPECT_EQ(source->header().geometry.spacing, (Vec3{0.5, 1, 2}));
    Bytes const all = read_volume(*source);
    EXPECT_EQ(std::to_integer<int>(all[0]), 2);
    EXPECT_EQ(std::to_integer<int>(all[1]), 1);
    EXPECT_EQ(std::to_integer<int>(all[2]), 4);
    EXPECT_FALSE(source->next_volume());
}

TEST(Raw, WrongByteCountsNameBothNumbers) {
    auto const options = raw_options({4, 4, 4}, DataType::uint16);
    for (std::size_t n : {0, 1, 127, 129, 4000}) {
        for (bool seekable : {true, false}) {
            auto const failure = caught([&] {
                std::string const contents(n, 'a');
                auto const source = open_volume(seekable ? memory_file(contents) : pipe_file(contents), options);
                ASSERT_TRUE(source->next_volume());
                read_volume(*source);
            });
            EXPECT_EQ(failure.kind, ErrorKind::data) << n;
            EXPECT_NE(failure.message.find("128 bytes expected"), std::string::npos) << failure.message;
            EXPECT_NE(failure.message.find(text(static_cast<std::int64_t>(n), " found")), std::string::npos)
                << failure.message;
        }
    }
}

TEST(Raw, ImpossibleSizesAllocateNothing) {
    for (Index3 dims : {Index3{1000000, 1000000, 1000000}, Index3{1ll << 40, 1ll << 40, 1ll << 40},
                        Index3{1, 1, 1ll << 62}, Index3{-1, 4, 4}, Index3{0, 1, 1}}) {
        auto const failure = caught([&] {
            auto const source = open_volume(memory_file("abc"), raw_options(dims, DataType::float64));
            source->next_volume();
        });
        EXPECT_EQ(failure.kind, ErrorKind::data);
    }
}

TEST(Raw, UnknownDimsSayWhatToType) {
    auto const failure = caught([] { open_volume(memory_file("abc", "scan.raw"), {}); });
    EXPECT_EQ(failure.kind, ErrorKind::usage);
    EXPECT_NE(failure.hint.find("--dims"), std::string::npos);
    EXPECT_EQ(caught([] { open_volume(memory_file("abc", "scan.xyz"), {}); }).kind, ErrorKind::data);
    ReadOptions options;
    options.format = "ra";
    EXPECT_NE(caught([&] { open_volume(memory_file("abc"), options); }).hint.find("'raw'"), std::string::npos);
}

TEST(Raw, WrittenAndReadBack) {
    Scratch const scratch;
    Header header;
    header.dims = {13, 7, 10};
    header.dtype = DataType::int16;
    Bytes const whole = noise(13 * 7 * 10 * 2, 5);
    for (std::string const name : {"a_13x7x10_int16.raw", "b_13x7x10_int16.raw.gz"}) {
        for (std::int64_t height : {1, 3, 100}) {
            WriteOptions options;
            options.force = true;
            write_volumes(scratch / name, {header}, {whole}, options, height);
            auto const open = [&] { return open_volume(open_bytes(scratch / name), {}); };
            auto const source = open();
            ASSERT_TRUE(source->next_volume());
            EXPECT_EQ(read_volume(*source, 4), whole);
            expect_regions(open, whole, 20);
        }
    }
    EXPECT_EQ(get_file(scratch / "a_13x7x10_int16.raw"), text_of(whole));
}

TEST(Raw, DamagedCompressionIsNoticed) {
    Scratch const scratch;
    Header header;
    header.dims = {20, 30, 10};
    Bytes const whole = noise(6000, 6);
    std::string const name = scratch / "a_20x30x10_uint8.raw.gz";
    write_volumes(name, {header}, {whole});
    std::string const good = get_file(name);
    for (std::size_t n = 0; n < good.size(); n += 97) {
        put_file(name, good.substr(0, n));
        EXPECT_EQ(caught([&] {
                      auto const source = open_volume(open_bytes(name), {});
                      source->next_volume();
                      read_volume(*source);
                  }).kind,
                  ErrorKind::data)
            << n;
    }
    std::string bad = good;
    bad[good.size() - 6] ^= 1; // the checksum
    put_file(name, bad);
    auto const failure = caught([&] {
        auto const source = open_volume(open_bytes(name), {});
        source->next_volume();
        read_volume(*source);
    });
    EXPECT_EQ(failure.kind, ErrorKind::data);
    EXPECT_NE(failure.message.find("damaged"), std::string::npos);
}

TEST(Deflate, BytesDependOnNothingButTheInput) {
    Scratch const scratch;
    for (std::size_t n :
         {std::size_t{0}, std::size_t{1}, std::size_t{262144}, std::size_t{524288}, std::size_t{3000001}}) {
        Bytes const data = noise(n, 8);
        std::string reference;
        for (std::size_t step : {std::size_t{4000000}, std::size_t{65537}, std::size_t{262144}}) {
            OutputFile file(scratch / "x.gz", true);
            DeflateWriter deflate(file, DeflateWriter::Wrapper::gzip, {});
            for (std::size_t i = 0; i < n; i += step) deflate.write(data.data() + i, std::min(step, n - i));
            deflate.finish();
            file.commit();
            if (reference.empty()) reference = get_file(scratch / "x.gz");
            EXPECT_EQ(get_file(scratch / "x.gz"), reference);
            EXPECT_EQ(static_cast<std::size_t>(deflate.bytes_written()), reference.size());
        }
        auto const bytes = memory_file(reference);
        auto const stream = decode(*bytes, Encoding::deflate, DataType::uint8);
        Bytes back(n + 1);
        ASSERT_EQ(stream->read(back.data(), n + 1), n);
        back.resize(n);
        EXPECT_EQ(back, data);
    }
}

TEST(Deflate, MembersFollowOneAnother) {
    Scratch const scratch;
    std::string both;
    for (std::string const part : {"first ", "second"}) {
        OutputFile file(scratch / "x.gz", true);
        DeflateWriter deflate(file, DeflateWriter::Wrapper::gzip, {});
        deflate.write(reinterpret_cast<std::byte const*>(part.data()), part.size());
        deflate.finish();
        file.commit();
        both += get_file(scratch / "x.gz");
    }
    auto const bytes = memory_file(both);
    Bytes back(100);
    back.resize(decode(*bytes, Encoding::deflate, DataType::uint8)->read(back.data(), 100));
    EXPECT_EQ(text_of(back), "first second");
}

TEST(ByteSource, LooksAheadOnPipesAndFiles) {
    for (bool seekable : {true, false}) {
        std::string contents = "line one\r\nline two\n\n";
        contents += std::string(40000, 'x') + "\nlast";
        auto const bytes = seekable ? memory_file(contents) : pipe_file(contents);
        EXPECT_EQ(bytes->seekable(), seekable);
        EXPECT_EQ(bytes->peek(4).size(), 4u);
        EXPECT_EQ(bytes->position(), 0);
        EXPECT_EQ(bytes->read_line(), "line one");
        EXPECT_EQ(bytes->position(), 10);
        EXPECT_EQ(bytes->read_line(), "line two");
        EXPECT_EQ(bytes->read_line(), "");
        std::string part(10, ' ');
        bytes->read_exactly(part.data(), 10);
        EXPECT_EQ(part, "xxxxxxxxxx");
        bytes->skip(39990 - 5);
        EXPECT_EQ(bytes->read_line(), "xxxxx");
        EXPECT_EQ(bytes->peek(100).size(), 4u);
        EXPECT_EQ(bytes->read_line(), "last");
        EXPECT_EQ(bytes->read_line(), std::nullopt);
        EXPECT_EQ(bytes->position(), static_cast<std::int64_t>(contents.size()));
        EXPECT_EQ(caught([&] { bytes->read_exactly(part.data(), 1); }).kind, ErrorKind::data);
    }
}

TEST(ByteSource, RefusesEndlessLines) {
    auto const bytes = memory_file(std::string(3 << 20, 'x'));
    EXPECT_EQ(caught([&] { bytes->read_line(); }).kind, ErrorKind::data);
}

TEST(ByteSource, SaysWhyAFileCannotBeRead) {
    auto const missing = caught([] { open_bytes("/nowhere/at all"); });
    EXPECT_EQ(missing.kind, ErrorKind::io);
    EXPECT_EQ(missing.message, "cannot open '/nowhere/at all': no such file or directory");
    EXPECT_EQ(caught([] { open_volume(open_bytes("/tmp"), {}); }).kind, ErrorKind::io);
}

TEST(OutputFile, AppearsOnlyWhenCommitted) {
    Scratch const scratch;
    {
        OutputFile file(scratch / "a", false);
        file.write("abc", 3);
        EXPECT_FALSE(std::filesystem::exists(scratch / "a"));
    }
    EXPECT_EQ(scratch.files(), 0u);
    OutputFile file(scratch / "a", false);
    file.write("abc", 3);
    file.write_at(1, "B", 1);
    file.commit();
    EXPECT_EQ(get_file(scratch / "a"), "aBc");
    EXPECT_EQ(scratch.files(), 1u);
    struct stat status {};
    ASSERT_EQ(::stat((scratch / "a").c_str(), &status), 0);
    mode_t const mask = ::umask(0);
    ::umask(mask);
    EXPECT_EQ(status.st_mode & 0777, 0666 & ~mask);
}

TEST(OutputFile, NeverOverwritesUnasked) {
    Scratch const scratch;
    put_file(scratch / "a", "old");
    auto const early = caught([&] { OutputFile(scratch / "a", false); });
    EXPECT_EQ(early.kind, ErrorKind::io);
    EXPECT_NE(early.hint.find("--force"), std::string::npos);
    // Somebody else is faster.
    OutputFile slow(scratch / "b", false);
    slow.write("slow", 4);
    put_file(scratch / "b", "fast");
    EXPECT_NE(caught([&] { slow.commit(); }).hint.find("--force"), std::string::npos);
    EXPECT_EQ(get_file(scratch / "b"), "fast");
    OutputFile forced(scratch / "a", true);
    forced.write("new", 3);
    EXPECT_EQ(get_file(scratch / "a"), "old");
    forced.commit();
    EXPECT_EQ(get_file(scratch / "a"), "new");
    EXPECT_EQ(scratch.files(), 2u);
}

TEST(OutputFile, SaysWhyItCannotWrite) {
    Scratch const scratch;
    auto const missing = caught([&] { OutputFile(scratch / "no/such/a.raw", false); });
    EXPECT_EQ(missing.kind, ErrorKind::io);
    EXPECT_NE(missing.message.find("no such file or directory"), std::string::npos);
    EXPECT_NE(missing.hint.find("no/such"), std::string::npos);
    EXPECT_EQ(caught([&] { OutputFile(scratch.path(), true); }).kind, ErrorKind::io);
    OutputFile full("/dev/full", false);
    EXPECT_TRUE(full.in_place());
    auto const enospc = caught([&] { full.write("abc", 3); });
    EXPECT_EQ(enospc.kind, ErrorKind::io);
    EXPECT_NE(enospc.message.find("no space left"), std::string::npos);
}

TEST(OutputFile, WriteErrorsSurfaceFromTheThread) {
    Header header;
    header.dims = {64, 64, 64};
    auto const failure =
        caught([&] { write_volumes("/dev/full", {header}, {noise(64 * 64 * 64, 1)}, {.format = "raw"}, 4); });
    EXPECT_EQ(failure.kind, ErrorKind::io);
}

TEST(OutputFile, PipesAreWrittenInPlace) {
    Scratch const scratch;
    std::string const name = scratch / "fifo";
    ASSERT_EQ(::mkfifo(name.c_str(), 0600), 0);
    std::string got;
    std::thread reader([&] { got = get_file(name); });
    OutputFile file(name, false);
    file.write("abc", 3);
    file.commit();
    reader.join();
    EXPECT_EQ(got, "abc");
}

TEST(OutputFile, RememberedTemporariesAreRemovable) {
    Scratch const scratch;
    put_file(scratch / ".a.vkt-1-2", "x");
    int const slot = remember_temporary(scratch / ".a.vkt-1-2");
    ASSERT_GE(slot, 0);
    remove_temporaries();
    EXPECT_EQ(scratch.files(), 0u);
    forget_temporary(slot);
}

TEST(OutputFile, LeftoversOfTheDeadAreRemovedThoseOfTheLivingAreNot) {
    Scratch const scratch;
    std::string const path = scratch / "a.raw";
    put_file(path, "old");
    put_file(temporary_name(path), "left by a process that was killed");
    std::string const living = temporary_name(path);
    put_file(living, "being written");
    int const owner = ::open(living.c_str(), O_RDONLY | O_CLOEXEC);
    mark_alive(owner);
    put_file(temporary_name(path), ""); // may be new
    put_file(temporary_name(scratch / "b.raw"), "of another file, whose writer was killed as well");
    std::string const other_living = temporary_name(scratch / "b.raw");
    put_file(other_living, "of another file, being written");
    int const other_owner = ::open(other_living.c_str(), O_RDONLY | O_CLOEXEC);
    mark_alive(other_owner);
    put_file(scratch / ".b.raw.vkt-notes", "somebody's own");
    ASSERT_EQ(scratch.files(), 7u);
    OutputFile file(path, true);
    file.write("new", 3);
    file.commit();
    EXPECT_EQ(get_file(path), "new");
    EXPECT_EQ(scratch.files(), 5u); // but those of the two that were killed
    EXPECT_EQ(get_file(living), "being written");
    EXPECT_EQ(get_file(other_living), "of another file, being written");
    EXPECT_EQ(get_file(scratch / ".b.raw.vkt-notes"), "somebody's own");
    ::close(owner);
    ::close(other_owner);
}

TEST(SlabSink, RefusesSlabsOutOfOrder) {
    Scratch const scratch;
    Header header;
    header.dims = {2, 2, 4};
    auto const sink = create_volume(scratch / "a.raw", {});
    sink->begin(header);
    EXPECT_THROW(sink->acquire({{0, 0, 1}, {2, 2, 2}}), Error);
    EXPECT_THROW(sink->end(), Error);
    EXPECT_THROW(sink->close(), Error);
    EXPECT_EQ(scratch.files(), 0u);
}

} // namespace
} // namespace vkt::testing
