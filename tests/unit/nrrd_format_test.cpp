// NRRD: every field that matters, every encoding, several files, series, and headers made to hurt.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/header_text.h"
#include "tests/unit/format_testing.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <sys/stat.h>

namespace vkt::testing {
namespace {

std::string string_of(Bytes const& bytes) { return {reinterpret_cast<char const*>(bytes.data()), bytes.size()}; }

ReadOptions trusting() {
    ReadOptions options;
    options.trust_paths = true;
    return options;
}

std::unique_ptr<Source> opened(std::string const& contents) {
    auto source = open_volume(memory_file(contents), {});
    EXPECT_TRUE(source->next_volume());
    return source;
}

Header header_of(std::string const& fields, std::size_t bytes = 0) {
    return opened("NRRD0005\n" + fields + "\n" + std::string(bytes, 'a'))->header();
}

Caught refused(std::string const& contents) {
    return caught([&] {
        auto const source = open_volume(memory_file(contents), {});
        while (source->next_volume()) read_volume(*source, 1);
    });
}

/// "type, dimension 3, sizes 5 4 3, encoding raw" of int16 and what else is said.
std::string basic(std::string const& more = "endian: little\n") {
    return "type: short\ndimension: 3\nsizes: 5 4 3\nencoding: raw\n" + more;
}

TEST(Nrrd, Geometry) {
    Header const a = header_of(basic("endian: little\nspace: RAS\nspace directions: (0,0.5,0) (-2,0,0) (0,0,4)\n"
                                     "space origin: (10,-20,30)\nkinds: domain domain domain\n"),
                               120);
    EXPECT_EQ(a.dims, (Index3{5, 4, 3}));
    EXPECT_EQ(a.dtype, DataType::int16);
    EXPECT_EQ(a.geometry.spacing, (Vec3{0.5, 2, 4}));
    EXPECT_EQ(a.geometry.direction[0], (Vec3{0, 1, 0}));
    EXPECT_EQ(a.geometry.direction[1], (Vec3{-1, 0, 0}));
    EXPECT_EQ(a.geometry.origin, (Vec3{10, -20, 30}));
    EXPECT_EQ(a.attributes.at("space"), "right-anterior-superior");
    EXPECT_EQ(a.attributes.count("kinds"), 0u);

    // Cells begin at the axis minimum; nodes lie on it.
    Header const b = header_of(basic("endian: little\nspacings: 0.5 nan 4\naxis mins: 1 2 3\naxis maxs: 3.5 10 15\n"
                                     "centers: cell cell node\n"),
                               120);
    EXPECT_EQ(b.geometry.spacing, (Vec3{0.5, 2, 4}));
    EXPECT_EQ(b.geometry.origin, (Vec3{1.25, 3, 3}));
    // A negative spacing is a direction.
    Header const c = header_of(basic("endian: little\nspacings: 1 -2 1\n"), 120);
    EXPECT_EQ(c.geometry.spacing, (Vec3{1, 2, 1}));
    EXPECT_EQ(c.geometry.direction[1], (Vec3{0, -1, 0}));
    // A slice in space gets the perpendicular direction.
    Header const d = header_of("type: uchar\ndimension: 2\nsizes: 5 4\nencoding: raw\nspace dimension: 3\n"
                               "space directions: (0,0,1) (1,0,0)\nspace origin: (nan,nan,nan)\n",
                               20);
    EXPECT_EQ(d.dims, (Index3{5, 4, 1}));
    EXPECT_EQ(d.geometry.direction[2], (Vec3{0, 1, 0}));
}

TEST(Nrrd, AttributesAndValueMap) {
    Header const a = header_of(
        basic("endian: little\ncontent: a head: of hair\nold min: -3.5\nsample units: \"HU\"\n"
              "space dimension: 3\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace units: \"mm\" \"mm\" \"mm\"\n"
              "labels: \"x \\\" y\" \"\" \"z\"\nkey one:=value: two\ntwo\\nlines:=a\\\\b\\nc\n"
              "vkt slope:=0.5\nvkt intercept:=-1024\n# a remark\n"),
        120);
    EXPECT_EQ(a.units, "HU");
    EXPECT_EQ(a.values, (ValueMap{0.5, -1024}));
    std::map<std::string, std::string> const expected{
        {"content", "a head: of hair"},        {"old min", "-3.5"},       {"space units", "\"mm\" \"mm\" \"mm\""},
        {"labels", "\"x \\\" y\" \"\" \"z\""}, {"key one", "value: two"}, {"two\nlines", "a\\b\nc"}};
    EXPECT_EQ(a.attributes, expected);
}

TEST(Nrrd, TypesAndOlderSpellings) {
    std::vector<std::pair<std::string, DataType>> const types{
        {"signed char", DataType::int8}, {"uint8_t", DataType::uint8}, {"unsigned short int", DataType::uint16},
        {"int32", DataType::int32},      {"uint", DataType::uint32},   {"long long int", DataType::int64},
        {"ulonglong", DataType::uint64}, {"float", DataType::float32}, {"double", DataType::float64}};
    for (auto const& [name, type] : types) {
        Header const h =
            header_of("Type: " + name + "\ndimension: 1\nsizes: 3\nencoding: raw\nendian: big\nbyteskip: 1\n", 30);
        EXPECT_EQ(h.dtype, type) << name;
        EXPECT_EQ(h.dims, (Index3{3, 1, 1}));
    }
    EXPECT_EQ(refused("NRRD0001\ntype: block\ndimension: 1\nsizes: 3\nencoding: raw\n\nabc").kind, ErrorKind::data);
}

TEST(Nrrd, EncodingsSkipsAndByteOrder) {
    Bytes const little = bytes_of(std::string("\x01\x00\xff\xff\x00\x01", 6));
    std::string const head = "NRRD0004\ntype: short\ndimension: 1\nsizes: 3\nencoding: ";
    auto const voxels = [&](std::string const& rest) {
        auto const source = opened(head + rest);
        return read_volume(*source);
    };
    EXPECT_EQ(voxels("raw\nendian: little\n\n" + string_of(little)), little);
    EXPECT_EQ(voxels(std::string("raw\nendian: big\n\n\x00\x01\xff\xff\x01\x00", 23)), little);
    EXPECT_EQ(voxels("raw\nendian: little\nline skip: 2\nbyte skip: 3\n\none\n\nabc" + string_of(little)), little);
    EXPECT_EQ(voxels("raw\nendian: little\nbyte skip: -1\n\nwhatever stands here" + string_of(little)), little);
    EXPECT_EQ(voxels("hex\nendian: big\n\n00 01 FF\nff01 0\n0\n"), little);
    EXPECT_EQ(voxels("text\n\n1, -1\n  256"), little);
    EXPECT_EQ(voxels("ascii\nline skip: 1\n\n# not this\n1.0 -1 2.56e2\n"), little);
    for (std::string const bad :
         {"text\n\n1 2", "text\n\n1 2 70000", "text\n\n1 2 0.5", "text\n\n1 2 three", "hex\nendian: big\n\n0001ff",
          "hex\nendian: big\n\n0001ffxx0000", "raw\nendian: little\n\nabcde", "raw\n\nabcdef",
          "raw\nendian: middle\n\nabcdef", "zrl\nendian: little\n\nabcdef", "gzip\nendian: little\n\nabcdef",
          "bzip2\nendian: little\n\nabcdef", "raw\nendian: little\nbyte skip: 9\n\nabcdef",
          "raw\nendian: little\nline skip: 9\n\nabcdef", "raw\nendian: little\nbyte skip: -2\n\nabcdef",
          "text\nbyte skip: -1\n\n1 2 3"}) {
        auto const failure = refused(head + bad);
        EXPECT_EQ(failure.kind, ErrorKind::data) << bad;
        EXPECT_FALSE(failure.message.empty()) << bad;
    }
}

TEST(Nrrd, TextKeepsAllDigits) {
    auto const source = opened("NRRD0001\ntype: longlong\ndimension: 1\nsizes: 3\nencoding: text\n\n"
                               "9223372036854775807 -9223372036854775808 9007199254740993\n");
    Bytes const all = read_volume(*source);
    std::int64_t values[3];
    std::memcpy(values, all.data(), sizeof values);
    EXPECT_EQ(values[0], std::numeric_limits<std::int64_t>::max());
    EXPECT_EQ(values[1], std::numeric_limits<std::int64_t>::min());
    EXPECT_EQ(values[2], 9007199254740993);
    auto const floats =
        opened("NRRD0001\ntype: double\ndimension: 1\nsizes: 4\nencoding: text\n\n0.1 nan -inf +1e-300");
    // What is too large or too small for the type rounds to infinity or zero.
    auto const far = opened("NRRD0001\ntype: double\ndimension: 1\nsizes: 8\nencoding: text\n\n"
                            "1e400 -1e400 1e-400 -0.1e-99999999999999999999 5e-324 1E+99999999999999999999 0.00001e405 "
                            "-100000e-405");
    double ends[8];
    std::memcpy(ends, read_volume(*far).data(), sizeof ends);
    double const infinity = std::numeric_limits<double>::infinity();
    double const expected[8] = {infinity, -infinity, 0.0, -0.0, 5e-324, infinity, infinity, -0.0};
    EXPECT_EQ(std::memcmp(ends, expected, sizeof ends), 0);
    auto const narrow = opened("NRRD0001\ntype: float\ndimension: 1\nsizes: 3\nencoding: text\n\n1e39 -1e-60 1e38");
    float narrow_ends[3];
    std::memcpy(narrow_ends, read_volume(*narrow).data(), sizeof narrow_ends);
    EXPECT_EQ(narrow_ends[0], std::numeric_limits<float>::infinity());
    EXPECT_TRUE(narrow_ends[1] == 0 && std::signbit(narrow_ends[1]));
    EXPECT_EQ(narrow_ends[2], 1e38F);
    for (std::string const word : {"1e400", "1e-400", "-1e400"})
        EXPECT_EQ(refused("NRRD0001\ntype: int\ndimension: 1\nsizes: 1\nencoding: text\n\n" + word).kind,
                  ErrorKind::data);
    Bytes const bytes = read_volume(*floats);
    double numbers[4];
    std::memcpy(numbers, bytes.data(), sizeof numbers);
    EXPECT_EQ(numbers[0], 0.1);
    EXPECT_TRUE(std::isnan(numbers[1]));
    EXPECT_EQ(numbers[2], -std::numeric_limits<double>::infinity());
    EXPECT_EQ(numbers[3], 1e-300);
}

TEST(Nrrd, TextRegionsAndLongWords) {
    Index3 const dims{9, 8, 7};
    Bytes const whole = noise(504, 3);
    std::string contents = "NRRD0001\ntype: uchar\ndimension: 3\nsizes: 9 8 7\nencoding: text\n\n";
    for (std::byte b : whole) contents += text(std::to_integer<int>(b), std::string(400, ' ')); // words cross blocks
    expect_regions([&] { return open_volume(memory_file(contents), {}); }, whole, 10);
    EXPECT_EQ(dims, opened(contents)->header().dims);
    EXPECT_EQ(
        refused("NRRD0001\ntype: uchar\ndimension: 1\nsizes: 9\nencoding: text\n\n" + std::string(200000, '1')).kind,
        ErrorKind::data);
}

/// A detached header with its files in a scratch directory.
struct Detached {
    Scratch scratch;
    Bytes whole = noise(6 * 5 * 4 * 2, 9);
    std::string open_with(std::string const& data, std::string const& more = "") {
        put_file(scratch / "a.nhdr",
                 "NRRD0004\ntype: ushort\ndimension: 3\nsizes: 6 5 4\nencoding: raw\nendian: little\n" + more +
                     "data file: " + data + "\n");
        return scratch / "a.nhdr";
    }
    void expect_same(std::string const& data, std::string const& more = "", ReadOptions const& options = {}) {
        std::string const path = open_with(data, more);
        auto const open = [&] { return open_volume(open_bytes(path), options); };
        auto const source = open();
        ASSERT_TRUE(source->next_volume());
        EXPECT_EQ(source->access(), Access::random);
        EXPECT_EQ(read_volume(*source, 3), whole);
        expect_regions(open, whole, 30);
    }
    std::string part(std::size_t i, std::size_t n) {
        return string_of(whole).substr(i * whole.size() / n, whole.size() / n);
    }
};

TEST(Nrrd, DetachedAndSeveralFiles) {
    Detached d;
    put_file(d.scratch / "a b.raw", string_of(d.whole));
    d.expect_same("a b.raw");
    d.expect_same(d.scratch / "a b.raw", "", trusting());
    put_file(d.scratch / "s.raw", "skip me\nxyz" + string_of(d.whole));
    d.expect_same("s.raw", "line skip: 1\nbyte skip: 3\n");
    d.expect_same("s.raw", "byte skip: -1\n");
    for (std::size_t i = 0; i < 4; ++i)
        put_file(d.scratch / text("p", static_cast<int>(7 - 2 * i), ".raw"), "x\n" + d.part(i, 4));
    d.expect_same("p%d.raw 7 1 -2", "line skip: 1\n");
    d.expect_same("p%01d.raw 7 1 -2 2", "byte skip: 2\n");
    for (std::size_t i = 0; i < 2; ++i) put_file(d.scratch / text("q", static_cast<int>(i), ".raw"), d.part(i, 2));
    d.expect_same("LIST 3\nq0.raw\nq1.raw");
    d.expect_same("q%01d.raw 0 1 1 3");
}

TEST(Nrrd, DetachedFailuresNameTheFile) {
    Detached d;
    auto const missing = caught([&] { open_volume(open_bytes(d.open_with("nothing.raw")), {})->next_volume(); });
    EXPECT_EQ(missing.kind, ErrorKind::io);
    EXPECT_NE(missing.message.find("nothing.raw"), std::string::npos);
    put_file(d.scratch / "short.raw", std::string(239, 'a'));
    auto const truncated = caught([&] { open_volume(open_bytes(d.open_with("short.raw")), {})->next_volume(); });
    EXPECT_EQ(truncated.kind, ErrorKind::data);
    EXPECT_NE(truncated.message.find("240 bytes expected, 239 found"), std::string::npos);
    for (std::string const bad :
         {"", "LIST", "LIST\n", "LIST 2\nshort.raw", "LIST\na\nb\nc\nd\ne\nf\ng", "x%d%d.raw 0 3 1", "x%s%d.raw 0 3 1",
          "x%d.raw 0 3 0", "x%d.raw 0 3 -1", "x%d.raw 0 9999999999 1", "x%d.raw 0 3 1 9", "x%d.raw 0 3 1 1"})
        EXPECT_EQ(caught([&] { open_volume(open_bytes(d.open_with(bad)), {})->next_volume(); }).kind, ErrorKind::data)
            << bad;
}

TEST(Nrrd, DataFilesElsewhereNeedTrust) {
    Detached d;
    Scratch const elsewhere;
    put_file(elsewhere / "secret.raw", string_of(d.whole));
    std::filesystem::create_directory(d.scratch / "sub");
    std::filesystem::create_directory(elsewhere / "sub");
    put_file(d.scratch / "sub/inside.raw", string_of(d.whole));
    std::filesystem::create_symlink("sub/inside.raw", d.scratch / "stays.raw");
    std::filesystem::create_symlink(d.scratch / "sub", d.scratch / "link");
    std::filesystem::create_symlink(elsewhere / "secret.raw", d.scratch / "leaves.raw");
    std::filesystem::create_directory_symlink(elsewhere.path(), d.scratch / "out");
    ASSERT_EQ(::mkfifo((d.scratch / "fifo").c_str(), 0600), 0);
    for (std::string const inside : {"sub/inside.raw", "./sub/../sub/inside.raw", "stays.raw", "link/inside.raw"})
        d.expect_same(inside);
    std::string const up = "../" + std::filesystem::path(elsewhere.path()).filename().string();
    for (std::string const& outside :
         {elsewhere / "secret.raw", d.scratch / "sub/inside.raw", up + "/secret.raw", std::string("leaves.raw"),
          std::string("out/secret.raw"),
          "out/../" + std::filesystem::path(elsewhere.path()).filename().string() + "/secret.raw"}) {
        auto const failure = caught([&] { open_volume(open_bytes(d.open_with(outside)), {}); });
        EXPECT_EQ(failure.kind, ErrorKind::data) << outside;
        EXPECT_NE(failure.hint.find("--trust-paths"), std::string::npos) << outside;
        d.expect_same(outside, "", trusting());
    }
    // Neither waits nor reads without end.
    for (std::string const special : {"fifo", "/dev/zero", ".", "..", "LIST\nfifo"}) {
        auto const failure = caught([&] { open_volume(open_bytes(d.open_with(special)), {}); });
        EXPECT_EQ(failure.kind, ErrorKind::data) << special;
        EXPECT_NE(failure.hint.find("--trust-paths"), std::string::npos) << special;
    }
}

TEST(Nrrd, NumberedFiles) {
    EXPECT_EQ(numbered_files("a%03d.raw", 8, 12, 2), (std::vector<std::string>{"a008.raw", "a010.raw", "a012.raw"}));
    EXPECT_EQ(numbered_files("%3d", -1, 0, 1), (std::vector<std::string>{" -1", "  0"}));
    EXPECT_EQ(numbered_files("%03d", -1, -1, 1), (std::vector<std::string>{"-01"}));
    EXPECT_FALSE(is_numbered("100%"));
    EXPECT_FALSE(is_numbered("%s%n"));
    EXPECT_FALSE(is_numbered("%99999999999d"));
}

TEST(Nrrd, FourthAxisIsASeries) {
    std::string const data = string_of(noise(2 * 3 * 4 * 3, 2));
    for (std::string const how :
         {"kinds: domain domain domain time\n", "kinds: space space space list\n", "",
          "space dimension: 3\nspace directions: (1,0,0) (0,1,0) (0,0,1) none\n",
          "space: RAST\nspace directions: (1,0,0,0) (0,1,0,0) (0,0,1,0) (0,0,0,7)\nspace origin: (0,0,0,5)\n"}) {
        auto const source = open_volume(
            memory_file("NRRD0005\ntype: uchar\ndimension: 4\nsizes: 2 3 4 3\nencoding: raw\n" + how + "\n" + data),
            {});
        for (std::size_t i = 0; i < 3; ++i) {
            ASSERT_TRUE(source->next_volume()) << how;
            EXPECT_EQ(source->header().dims, (Index3{2, 3, 4}));
            EXPECT_EQ(string_of(read_volume(*source, 3)), data.substr(24 * i, 24));
        }
        EXPECT_FALSE(source->next_volume());
    }
}

TEST(Nrrd, ValuesSideBySideAreAVolumeEach) {
    std::string const head = "NRRD0005\ntype: uchar\nencoding: raw\n";
    std::string const data = string_of(noise(72, 5));
    struct Case {
        char const* fields;
        int count;
        bool first; ///< the axis of the values
    };
    for (Case const& c :
         {Case{"dimension: 4\nsizes: 3 2 3 4\nkinds: RGB-color domain domain domain\n", 3, true},
          {"dimension: 4\nsizes: 3 2 3 4\nkinds: list domain domain domain\n", 3, true},
          {"dimension: 3\nsizes: 3 2 12\nkinds: vector domain domain\n", 3, true},
          {"dimension: 3\nsizes: 6 4 3\nkinds: domain domain RGB-color\n", 3, false},
          {"dimension: 3\nsizes: 6 4 3\nkinds: domain domain RGB-color\nspace dimension: 2\n"
           "space directions: (1,0) (0,1) none\n",
           3, false},
          {"dimension: 3\nsizes: 6 6 2\nkinds: space space complex\n", 2, false},
          {"dimension: 4\nsizes: 2 3 4 3\nkinds: domain domain domain 3-color\n", 3, false},
          {"dimension: 4\nsizes: 2 3 4 3\nkinds: space space space vector\nspace dimension: 3\n"
           "space directions: (1,0,0) (0,1,0) (0,0,1) none\n",
           3, false},
          {"dimension: 4\nsizes: 3 2 3 4\nspace dimension: 3\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\n", 3,
           true}}) {
        auto const source = open_volume(memory_file(head + c.fields + "\n" + data), {});
        std::size_t const count = static_cast<std::size_t>(c.count), each = 72 / count;
        for (std::size_t i = 0; i < count; ++i) {
            ASSERT_TRUE(source->next_volume()) << c.fields;
            std::string want;
            for (std::size_t k = 0; k < each; ++k) want += data[c.first ? k * count + i : i * each + k];
            EXPECT_EQ(string_of(read_volume(*source, 2)), want) << c.fields << i;
            EXPECT_EQ(source->header().attributes.at("channel"), std::to_string(i)) << c.fields;
        }
        EXPECT_FALSE(source->next_volume()) << c.fields;
    }
}

TEST(Nrrd, ValuesBetweenAxesOfSpaceAreRefusedWithAHint) {
    for (std::string const fields : {"dimension: 4\nsizes: 2 3 3 4\nkinds: domain vector domain domain\n",
                                     "dimension: 4\nsizes: 2 3 3 4\nkinds: domain domain list domain\n",
                                     "dimension: 1\nsizes: 72\nkinds: list\n"}) {
        auto const failure = refused("NRRD0005\ntype: uchar\nencoding: raw\n" + fields + "\n" + std::string(72, 'a'));
        EXPECT_EQ(failure.kind, ErrorKind::data);
        EXPECT_NE(failure.hint.find("unu"), std::string::npos) << fields << failure.message;
    }
    EXPECT_EQ(header_of("type: uchar\ndimension: 4\nsizes: 1 2 3 4\nencoding: raw\n", 24).dims, (Index3{2, 3, 4}));
    EXPECT_EQ(header_of("type: uchar\ndimension: 4\nsizes: 2 3 1 4\nencoding: raw\n", 24).dims, (Index3{2, 3, 1}));
    // One value for each voxel is a volume, however many axes say so.
    EXPECT_EQ(
        header_of("type: uchar\ndimension: 5\nsizes: 1 2 3 4 1\nencoding: raw\nkinds: stub domain domain domain list\n",
                  24)
            .dims,
        (Index3{2, 3, 4}));
    EXPECT_EQ(header_of("type: uchar\ndimension: 3\nsizes: 2 3 4\nencoding: raw\nkinds: domain domain list\n", 24).dims,
              (Index3{2, 3, 4}));
}

TEST(Nrrd, MalformedHeadersAreRefused) {
    std::string const data(200, 'a');
    for (std::string const fields :
         {"",
          "type: short\n",
          "type: short\ndimension: 3\nsizes: 5 4 3\n",
          "dimension: 3\nsizes: 5 4 3\nencoding: raw\n",
          "type: uchar\ndimension: 0\nsizes:\nencoding: raw\n",
          "type: uchar\ndimension: 17\nsizes: 1\nencoding: raw\n",
          "type: uchar\ndimension: three\nsizes: 1\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 5 4\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 -3\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 0\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 99999999999999999999\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 1000000000000 1000000000000 1000000000000\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 3037000500 3037000500 2\nencoding: raw\n",
          "type: uchar\ndimension: 4\nsizes: 1000000 1000000 1000000 1000000000000\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 100000 100000 100000\nencoding: gzip\n",
          "type: uchar\ndimension: 3\nsizes: 100000 100000 100000\nencoding: text\n",
          "type: uchar\ndimension: 3\nsizes: 100000 100000 100000\nencoding: hex\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspacings: 1 0 1\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspacings: 1 inf 1\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspacings: 1 x 1\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspacings: 1 1\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspace directions: (1,0,0) (1,0,0) (0,0,1)\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspace directions: (1,0,0) (0,1,0)\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspace directions: (1,0,0) (0,1,0) (0,0,1\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspace directions: (1,0,0) (0,1,0) (0,0,0)\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspace directions: (1,0,0) (0,1,0) (0,0,1,2,3)\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspace origin: (inf,0,0)\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nspace origin: (1,0,0) (1,2,3)\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nlabels: \"a\" \"b\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nlabels: \"a\"\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nvkt slope:=0\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nvkt slope:=steep\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nsizes: 5 4 3\nencoding: raw\n",
          "type: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\nno colon\n"}) {
        for (bool detached : {false, true}) {
            auto const failure = refused("NRRD0005\n" + fields + (detached ? "" : "\n" + data));
            EXPECT_EQ(failure.kind, ErrorKind::data) << fields;
            EXPECT_FALSE(failure.message.empty()) << fields;
        }
    }
    auto const misspelt = refused("NRRD0005\ntype: uchar\nspacing: 1 1 1\n\n");
    EXPECT_NE(misspelt.hint.find("'spacings'"), std::string::npos);
    EXPECT_EQ(refused("NRRD0009\n").kind, ErrorKind::data);
    std::string endless = "NRRD0005\n";
    for (int i = 0; i < 300000; ++i) endless += text("key", i, ":=", std::string(60, 'v'), "\n");
    EXPECT_EQ(refused(endless).kind, ErrorKind::data);
}

TEST(Nrrd, TruncatedAnywhereIsAnError) {
    Scratch const scratch;
    Header header;
    header.dims = {7, 5, 3};
    header.dtype = DataType::float32;
    Bytes const whole = noise(7 * 5 * 3 * 4, 4);
    for (bool compress : {false, true}) {
        std::string const name = scratch / (compress ? "z.nrrd" : "a.nrrd");
        WriteOptions options;
        options.compress = compress;
        write_volumes(name, {header}, {whole}, options);
        std::string const good = get_file(name);
        EXPECT_TRUE(refused(good).message.empty());
        for (std::size_t n = 0; n < good.size(); ++n) {
            EXPECT_EQ(refused(good.substr(0, n)).kind, ErrorKind::data) << n;
            auto const piped = caught([&] {
                auto const source = open_volume(pipe_file(good.substr(0, n)), {});
                while (source->next_volume()) read_volume(*source, 1);
            });
            EXPECT_EQ(piped.kind, ErrorKind::data) << n;
        }
    }
}

Header rich_header() {
    Header header;
    header.dims = {7, 5, 6};
    header.dtype = DataType::uint16;
    header.geometry.origin = {0.1, -20.25, 1e-7};
    header.geometry.spacing = {0.3, 1.0 / 3, 7};
    double const c = std::cos(0.3), s = std::sin(0.3);
    header.geometry.direction = {{{c, s, 0}, {-s, c, 0}, {0, 0, 1}}};
    header.values = {0.25, -1000.125};
    header.units = "HU";
    header.attributes = {{"space", "left-posterior-superior"},          {"content", "a test"},
                         {"note: of\nsorts", "two\nlines \\ and more"}, {"labels", "\"x\" \"y\" \"z\""},
                         {"space units", "\"mm\" \"mm\" \"mm\""},       {"old max", "4095"}};
    header.history = History{{"crop", "--roi", "1:2,:,:"}, {History{{"read", "a \"b\".raw"}, {}}}};
    return header;
}

void expect_same_header(Header const& a, Header const& b) {
    EXPECT_EQ(a.dims, b.dims);
    EXPECT_EQ(a.dtype, b.dtype);
    EXPECT_TRUE(same_geometry(a.geometry, b.geometry));
    EXPECT_EQ(a.values, b.values);
    EXPECT_EQ(a.units, b.units);
    EXPECT_EQ(a.attributes, b.attributes);
    EXPECT_EQ(a.history, b.history);
}

TEST(Nrrd, WrittenAndReadBack) {
    Scratch const scratch;
    Header const header = rich_header();
    Bytes const whole = noise(header.bytes(), 11);
    for (std::string const name : {"a.nrrd", "a.nhdr"})
        for (bool compress : {false, true}) {
            WriteOptions options;
            options.compress = compress;
            options.force = true;
            write_volumes(scratch / name, {header}, {whole}, options);
            auto const open = [&] { return open_volume(open_bytes(scratch / name), {}); };
            auto const source = open();
            ASSERT_TRUE(source->next_volume());
            expect_same_header(source->header(), header);
            EXPECT_EQ(read_volume(*source, 4), whole);
            expect_regions(open, whole, 20);
        }
    for (int i = 0; i < data_type_count; ++i) {
        Header typed;
        typed.dims = {3, 2, 1};
        typed.dtype = static_cast<DataType>(i);
        typed.error = VolumeError::given(); // which is what a file without a history holds
        Bytes const voxels = noise(typed.bytes(), 1);
        WriteOptions options;
        options.force = true;
        auto const failure = caught([&] { write_volumes(scratch / "t.nrrd", {typed}, {voxels}, options); });
        if (typed.dtype == DataType::float16) {
            EXPECT_EQ(failure.kind, ErrorKind::usage);
            continue;
        }
        auto const source = open_volume(open_bytes(scratch / "t.nrrd"), {});
        ASSERT_TRUE(source->next_volume());
        EXPECT_EQ(source->header(), typed);
        EXPECT_EQ(read_volume(*source), voxels);
    }
}

TEST(Nrrd, SeriesAreWrittenAndReadBack) {
    Scratch const scratch;
    Header header = rich_header();
    header.attributes["sequence kind"] = "time";
    std::vector<Header> const headers(3, header);
    std::vector<Bytes> const volumes{noise(header.bytes(), 1), noise(header.bytes(), 2), noise(header.bytes(), 3)};
    for (std::string const name : {"a.nrrd", "a.nhdr"})
        for (bool compress : {false, true}) {
            WriteOptions options;
            options.compress = compress;
            options.force = true;
            write_volumes(scratch / name, headers, volumes, options);
            auto const source = open_volume(open_bytes(scratch / name), {});
            for (auto const& volume : volumes) {
                ASSERT_TRUE(source->next_volume()) << name;
                expect_same_header(source->header(), header);
                EXPECT_EQ(read_volume(*source, 4), volume);
            }
            EXPECT_FALSE(source->next_volume());
        }
    Header other = header;
    other.dims = {7, 5, 1};
    auto const failure = caught([&] { write_volumes(scratch / "x.nrrd", {header, other}, {volumes[0], volumes[1]}); });
    EXPECT_EQ(failure.kind, ErrorKind::usage);
    EXPECT_FALSE(std::filesystem::exists(scratch / "x.nrrd"));
}

TEST(Nrrd, ExistingFilesOfADetachedPairAreKept) {
    Scratch const scratch;
    Header header;
    header.dims = {2, 2, 2};
    put_file(scratch / "a.raw", "precious");
    EXPECT_EQ(caught([&] { write_volumes(scratch / "a.nhdr", {header}, {noise(8, 1)}); }).kind, ErrorKind::io);
    EXPECT_EQ(get_file(scratch / "a.raw"), "precious");
    EXPECT_EQ(scratch.files(), 1u);
}

} // namespace
} // namespace vkt::testing
