// MetaImage: old and new fields, encodings, several files, series, anatomical frames, and headers made to hurt.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"
#include "tests/unit/format_testing.h"

#include <cmath>

namespace vkt::testing {
namespace {

std::string string_of(Bytes const& bytes) { return {reinterpret_cast<char const*>(bytes.data()), bytes.size()}; }

/// "ObjectType, NDims 3, DimSize 5 4 3, MET_SHORT" and what else is said, with 120 bytes of data inside.
std::string local(std::string const& more, std::size_t bytes = 120) {
    return "ObjectType = Image\nNDims = 3\nDimSize = 5 4 3\nElementType = MET_SHORT\n" + more +
           "ElementDataFile = LOCAL\n" + std::string(bytes, 'a');
}

Header header_of(std::string const& contents) {
    auto const source = open_volume(memory_file(contents), {});
    EXPECT_TRUE(source->next_volume());
    return source->header();
}

Caught refused(std::string const& contents) {
    return caught([&] {
        auto const source = open_volume(memory_file(contents, "a.mha"), {});
        while (source->next_volume()) read_volume(*source, 1);
    });
}

TEST(MetaImage, Geometry) {
    Header const a =
        header_of(local("TransformMatrix = 0 1 0 -1 0 0 0 0 2\nOffset = 1 2 -3e0\nElementSpacing = 0.5 1.5 2\n"
                        "ElementSize = 9 9 9\nAnatomicalOrientation = PRI\n"));
    EXPECT_EQ(a.dims, (Index3{5, 4, 3}));
    EXPECT_EQ(a.geometry.spacing, (Vec3{0.5, 1.5, 4})); // the last row is two long
    EXPECT_EQ(a.geometry.origin, (Vec3{1, 2, -3}));
    EXPECT_EQ(a.geometry.direction[0], (Vec3{0, 1, 0}));
    EXPECT_EQ(a.geometry.direction[1], (Vec3{-1, 0, 0}));
    EXPECT_EQ(a.geometry.direction[2], (Vec3{0, 0, 1}));
    EXPECT_EQ(a.attributes.at("space"), "left-posterior-superior");
    // Older spellings; the size of a voxel is the spacing if nothing else is.
    Header const b =
        header_of(local("Position = 1 2 3\nOrientation = 1 0 0 0 1 0 0 0 1\nElementSize = 4.000000e+000 5 6\n"
                        "AnatomicalOrientation = ???\n"));
    EXPECT_EQ(b.geometry.spacing, (Vec3{4, 5, 6}));
    EXPECT_EQ(b.geometry.origin, (Vec3{1, 2, 3}));
    EXPECT_EQ(b.attributes.count("space"), 0u);
    Header const c = header_of(
        "NDims = 2\nDimSize = 5 4\nElementType = MET_UCHAR\nTransformMatrix = 0 1 1 0\nElementDataFile = LOCAL\n" +
        std::string(20, 'a'));
    EXPECT_EQ(c.dims, (Index3{5, 4, 1}));
    EXPECT_EQ(c.geometry.direction[2], (Vec3{0, 0, -1}));
}

TEST(MetaImage, AttributesAndValueMap) {
    Header const a =
        header_of(local("Modality = MET_MOD_MR\nComment = as it is = so\nElementToIntensityFunctionSlope = 0.5\n"
                        "ElementToIntensityFunctionOffset = -7\nDistanceUnits = mm\n"));
    EXPECT_EQ(a.values, (ValueMap{0.5, -7}));
    EXPECT_EQ(a.attributes.at("Modality"), "MET_MOD_MR");
    EXPECT_EQ(a.attributes.at("Comment"), "as it is = so");
    EXPECT_EQ(a.attributes.at("space units"), "\"mm\" \"mm\" \"mm\"");
}

TEST(MetaImage, TypesEncodingsAndByteOrder) {
    std::vector<std::pair<std::string, DataType>> const types{
        {"MET_CHAR", DataType::int8},         {"MET_UCHAR", DataType::uint8},
        {"MET_SHORT", DataType::int16},       {"MET_USHORT", DataType::uint16},
        {"MET_INT", DataType::int32},         {"MET_UINT", DataType::uint32},
        {"MET_LONG", DataType::int32},        {"MET_ULONG", DataType::uint32},
        {"MET_LONG_LONG", DataType::int64},   {"MET_FLOAT", DataType::float32},
        {"MET_ULONG_LONG", DataType::uint64}, {"MET_DOUBLE_ARRAY", DataType::float64}};
    for (auto const& [name, type] : types)
        EXPECT_EQ(header_of("NDims = 1\nDimSize = 2\nElementType = " + name + "\nElementDataFile = LOCAL\n" +
                            std::string(16, 'a'))
                      .dtype,
                  type)
            << name;
    Bytes const little = bytes_of(std::string("\x01\x00\xff\xff\x00\x01", 6));
    std::string const head = "NDims = 1\nDimSize = 3\nElementType = MET_SHORT\n";
    auto const voxels = [&](std::string const& rest) {
        auto const source = open_volume(memory_file(head + rest), {});
        EXPECT_TRUE(source->next_volume());
        return read_volume(*source);
    };
    std::string const big("\x00\x01\xff\xff\x01\x00", 6);
    EXPECT_EQ(voxels("BinaryData = True\nElementDataFile = LOCAL\n" + string_of(little)), little);
    EXPECT_EQ(voxels("BinaryDataByteOrderMSB = True\nElementDataFile = LOCAL\n" + big), little);
    EXPECT_EQ(voxels("ElementByteOrderMSB = True\nElementDataFile = LOCAL\n" + big), little);
    EXPECT_EQ(voxels("HeaderSize = 4\nElementDataFile = LOCAL\nskip" + string_of(little)), little);
    EXPECT_EQ(voxels("HeaderSize = -1\nElementDataFile = LOCAL\nwhatever" + string_of(little)), little);
    EXPECT_EQ(voxels("BinaryData = False\nElementDataFile = LOCAL\n1 -1 256\n"), little);
}

TEST(MetaImage, SeveralFiles) {
    Scratch const scratch;
    Bytes const whole = noise(6 * 5 * 4 * 2, 9);
    auto const expect_same = [&](std::string const& data, std::string const& more = "") {
        put_file(scratch / "a.mhd",
                 "NDims = 3\nDimSize = 6 5 4\nElementType = MET_USHORT\n" + more + "ElementDataFile = " + data + "\n");
        auto const open = [&] { return open_volume(open_bytes(scratch / "a.mhd"), {}); };
        auto const source = open();
        ASSERT_TRUE(source->next_volume());
        EXPECT_EQ(source->access(), Access::random);
        EXPECT_EQ(read_volume(*source, 3), whole);
        expect_regions(open, whole, 30);
    };
    std::string const all = string_of(whole);
    put_file(scratch / "a b.raw", all);
    for (std::size_t i = 0; i < 4; ++i)
        put_file(scratch / text("p", static_cast<int>(1 + 2 * i), ".raw"), "x\n" + all.substr(i * 60, 60));
    expect_same("a b.raw");
    expect_same("p%d.raw 1 7 2", "HeaderSize = 2\n");
    expect_same("LIST\np1.raw\np3.raw\n p5.raw\np7.raw", "HeaderSize = -1\n");
    expect_same("LIST 3D\na b.raw");
    for (std::string const bad : {"", "LIST\np1.raw", "LIST 3D\np1.raw\np3.raw", "p%d.raw 1 7 -2", "p%d.raw 1 x"}) {
        auto const failure = caught([&] { expect_same(bad); });
        EXPECT_EQ(failure.kind, bad == "p%d.raw 1 7" ? ErrorKind::io : ErrorKind::data) << bad;
    }
    EXPECT_EQ(caught([&] { expect_same("missing.raw"); }).kind, ErrorKind::io);
}

TEST(MetaImage, MalformedHeadersAreRefused) {
    for (std::string const header :
         {"",
          "NDims = 3\n",
          "NDims = 0\nDimSize =\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 5\nDimSize = 1 1 1 1 1\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = x\nDimSize = 1\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 3\nDimSize = 5 4\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 3\nDimSize = 5 4 -3\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 3\nDimSize = 5 4 99999999999999999999\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 3\nDimSize = 1000000000000 1000000000000 1000000000000\nElementType = MET_CHAR\nElementDataFile = "
          "LOCAL\n",
          "NDims = 3\nDimSize = 100000 100000 100000\nElementType = MET_CHAR\nCompressedData = True\nElementDataFile = "
          "LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_STRING\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementDataFile = LOCAL\n",
          "NDims = 1\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_CHAR\nHeaderSize = -2\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_CHAR\nElementSpacing = 0\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_CHAR\nElementSpacing = nan\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_CHAR\nOffset = inf\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_CHAR\nOffset = one\nElementDataFile = LOCAL\n",
          "NDims = 2\nDimSize = 5 1\nElementType = MET_CHAR\nTransformMatrix = 1 0 1 0\nElementDataFile = LOCAL\n",
          "NDims = 2\nDimSize = 5 1\nElementType = MET_CHAR\nTransformMatrix = 1 0 1\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_CHAR\nElementNumberOfChannels = 0\nElementDataFile = LOCAL\n",
          "ObjectType = Tube\nNDims = 1\nDimSize = 5\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nDimSize = 5\nElementType = MET_CHAR\nElementDataFile = LOCAL\n",
          "NDims = 1\nDimSize = 5\nElementType = MET_CHAR\nno sense\nElementDataFile = LOCAL\n"}) {
        auto const failure = refused(std::string(header) + "aaaaaaaaaa");
        EXPECT_EQ(failure.kind, ErrorKind::data) << header;
        EXPECT_FALSE(failure.message.empty()) << header;
    }
}

TEST(MetaImage, TruncatedAnywhereIsAnError) {
    Scratch const scratch;
    Header header;
    header.dims = {7, 5, 3};
    header.dtype = DataType::float32;
    Bytes const whole = noise(7 * 5 * 3 * 4, 4);
    for (bool compress : {false, true}) {
        WriteOptions options;
        options.compress = compress;
        options.force = true;
        write_volumes(scratch / "a.mha", {header}, {whole}, options);
        std::string const good = get_file(scratch / "a.mha");
        EXPECT_TRUE(refused(good).message.empty());
        for (std::size_t n = 0; n < good.size(); ++n) {
            // Cut within "LOCAL" the header names a file that is not there.
            auto const failure = refused(good.substr(0, n));
            EXPECT_TRUE(failure.kind == ErrorKind::data || failure.message.find("cannot open 'L") == 0)
                << n << failure.message;
        }
    }
}

Header oblique() {
    Header header;
    header.dims = {7, 5, 6};
    header.dtype = DataType::int16;
    double const c = std::cos(0.3), s = std::sin(0.3);
    header.geometry = {{0.1, -20.25, 1e-7}, {0.3, 1.0 / 3, 7}, {{{c, s, 0}, {-s, c, 0}, {0, 0, 1}}}};
    header.values = {0.25, -1000.125};
    header.units = "HU";
    header.attributes = {{"space", "left-posterior-superior"}, {"Modality", "MET_MOD_CT"}};
    header.history = History{{"crop", "--roi", "1:2,:,:"}, {}};
    return header;
}

TEST(MetaImage, WrittenAndReadBack) {
    Scratch const scratch;
    Header const header = oblique();
    std::vector<Bytes> const volumes{noise(header.bytes(), 1), noise(header.bytes(), 2), noise(header.bytes(), 3)};
    for (std::size_t count : {1u, 3u})
        for (std::string const name : {"a.mha", "a.mhd"})
            for (bool compress : {false, true}) {
                WriteOptions options;
                options.compress = compress;
                options.force = true;
                std::vector<Header> const headers(count, header);
                write_volumes(scratch / name, headers,
                              {volumes.begin(), volumes.begin() + static_cast<std::ptrdiff_t>(count)}, options);
                auto const open = [&] { return open_volume(open_bytes(scratch / name), {}); };
                auto const source = open();
                for (std::size_t i = 0; i < count; ++i) {
                    ASSERT_TRUE(source->next_volume());
                    Header const& back = source->header();
                    EXPECT_TRUE(same_geometry(back.geometry, header.geometry));
                    EXPECT_EQ(back.values, header.values);
                    EXPECT_EQ(back.units, header.units);
                    EXPECT_EQ(back.attributes, header.attributes);
                    EXPECT_EQ(back.history, header.history);
                    EXPECT_EQ(read_volume(*source, 4), volumes[i]);
                }
                EXPECT_FALSE(source->next_volume());
                if (count == 1) expect_regions(open, volumes[0], 20);
            }
}

TEST(MetaImage, AnatomicalFramesBecomeLps) {
    Scratch const scratch;
    Header header = oblique();
    header.attributes["space"] = "right-anterior-superior";
    write_volumes(scratch / "a.mha", {header}, {noise(header.bytes(), 1)});
    auto const source = open_volume(open_bytes(scratch / "a.mha"), {});
    ASSERT_TRUE(source->next_volume());
    Header const& back = source->header();
    EXPECT_EQ(back.attributes.at("space"), "left-posterior-superior");
    for (Vec3 const index : {Vec3{0, 0, 0}, Vec3{1, 2, 3}}) {
        Vec3 const ras = index_to_world(header.geometry, index), lps = index_to_world(back.geometry, index);
        EXPECT_NEAR(ras.x, -lps.x, 1e-12);
        EXPECT_NEAR(ras.y, -lps.y, 1e-12);
        EXPECT_NEAR(ras.z, lps.z, 1e-12);
    }
    EXPECT_NE(get_file(scratch / "a.mha").find("AnatomicalOrientation = LPI"), std::string::npos);
}

TEST(MetaImage, RefusesWhatItCannotHold) {
    Scratch const scratch;
    Header header;
    header.dims = {2, 2, 2};
    header.dtype = DataType::float16;
    EXPECT_EQ(caught([&] { write_volumes(scratch / "a.mha", {header}, {noise(16, 1)}); }).kind, ErrorKind::usage);
    header.dtype = DataType::uint8;
    Header other = header;
    other.dims = {2, 2, 1};
    EXPECT_EQ(caught([&] {
                  write_volumes(scratch / "a.mha", {header, other}, {noise(8, 1), noise(4, 1)});
              }).kind,
              ErrorKind::usage);
    EXPECT_EQ(scratch.files(), 0u);
}

} // namespace
} // namespace vkt::testing
