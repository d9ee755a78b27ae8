// MetaImage files: .mha with the voxels inside and .mhd beside a .raw or .zraw, as ITK and VTK write them.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/metaimage_header.h"
#include "libvkt/formats/slab_sink.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vkt {

namespace {

bool is_metaimage(std::span<std::byte const> head) {
    // Text with a line "NDims = …": every MetaImage has one, and the first line is a field as well.
    std::string_view const content(reinterpret_cast<char const*>(head.data()), head.size());
    if (content.substr(0, content.find('\n')).find_first_of("=:") == std::string_view::npos) return false;
    for (std::size_t at = content.find("NDims"); at != std::string_view::npos; at = content.find("NDims", at + 1)) {
        std::string_view const rest = trimmed(content.substr(at + 5, content.find('\n', at) - at - 5));
        if ((at == 0 || content[at - 1] == '\n') && !rest.empty() && (rest.front() == '=' || rest.front() == ':'))
            return true;
    }
    return false;
}

std::unique_ptr<Source> open_metaimage(std::unique_ptr<ByteSource> bytes, ReadOptions const&) {
    RawLayout layout = metaimage_layout(read_metaimage_header(*bytes));
    return raw_source(std::move(bytes), std::move(layout));
}

/// MetaImage files lie in left-posterior-superior coordinates: other anatomical frames are turned into that one.
Geometry in_lps(Header const& header) {
    Geometry g = header.geometry;
    auto const space = header.attributes.find("space");
    if (space == header.attributes.end()) return g;
    auto const flip = [&](int world) {
        g.origin[world] = 0.0 - g.origin[world];
        for (auto& direction : g.direction) direction[world] = 0.0 - direction[world];
    };
    if (space->second == "right-anterior-superior") flip(0);
    if (space->second == "right-anterior-superior" || space->second == "left-anterior-superior") flip(1);
    return g;
}

bool is_anatomical(Header const& header) {
    auto const space = header.attributes.find("space");
    return space != header.attributes.end() &&
           (space->second == "left-posterior-superior" || space->second == "right-anterior-superior" ||
            space->second == "left-anterior-superior");
}

/// For each axis the side of the body it comes from, e.g. RAI for axes along left, posterior, superior. `???` if two
/// axes are nearest to the same line of the body.
std::string orientation(Geometry const& lps) {
    std::string letters;
    unsigned seen = 0;
    for (auto const& d : lps.direction) {
        int main = 0;
        for (int i = 1; i < 3; ++i)
            if (std::abs(d[i]) > std::abs(d[main])) main = i;
        seen |= 1u << main;
        letters += d[main] > 0 ? "RAI"[main] : "LPS"[main];
    }
    return seen == 7 ? letters : "???";
}

std::string one_line(std::string s) {
    for (char& c : s)
        if (c == '\n' || c == '\r') c = ' ';
    return s;
}

/// Only what MetaIO's own parser reads as a field goes into the file as one.
bool is_writable_key(std::string const& key) {
    return !key.empty() && !is_metaimage_field(key) && std::all_of(key.begin(), key.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    });
}

/// ITK and VTK give up on lines of 32 KiB and more.
constexpr std::size_t most_history = 32'000;

/// Everything before ElementDataFile. `compressed` < 0: not compressed.
std::string metaimage_fields(Header const& header, std::int64_t volumes, std::int64_t compressed) {
    bool const series = volumes > 1;
    Geometry const g = in_lps(header);
    std::string result =
        text("ObjectType = Image\nNDims = ", series ? 4 : 3, "\nBinaryData = True\nBinaryDataByteOrderMSB = False\n");
    result += text("CompressedData = ", compressed < 0 ? "False" : "True", "\n");
    if (compressed >= 0) result += text("CompressedDataSize = ", compressed, "\n");
    result += "TransformMatrix =";
    for (auto const& d : g.direction) result += text(" ", d, series ? " 0" : "");
    result += series ? " 0 0 0 1\n" : "\n";
    result += text("Offset = ", g.origin, series ? " 0" : "", "\nCenterOfRotation = 0 0 0", series ? " 0" : "", "\n");
    if (is_anatomical(header)) result += text("AnatomicalOrientation = ", orientation(g), "\n");
    result += text("ElementSpacing = ", g.spacing, series ? " 1" : "", "\nDimSize = ", header.dims,
                   series ? text(" ", volumes) : "", "\n");
    if (header.values != ValueMap{})
        result += text("ElementToIntensityFunctionSlope = ", header.values.slope,
                       "\nElementToIntensityFunctionOffset = ", header.values.intercept, "\n");
    if (auto const space = header.attributes.find("space"); space != header.attributes.end() && !is_anatomical(header))
        result += text("VktSpace = ", one_line(space->second), "\n");
    if (!header.units.empty()) result += text("VktUnits = ", one_line(header.units), "\n");
    for (auto const& [key, value] : header.attributes)
        if (key != "space" && key != "Comment" && is_writable_key(key))
            result += text(key, " = ", one_line(value), "\n");
    if (header.history) result += text("VktHistory = ", history_text(*header.history, most_history), "\n");
    return result + text("ElementType = ", metaimage_type_name(header.dtype), "\n");
}

/// Room for what an attached header learns only at the end: the compressed size and a fourth dimension.
constexpr std::size_t reserve = 96;

/// Filled up with a comment to the given length, or to its natural length and the reserve.
std::string attached_header(HeaderText const& h) {
    std::string const fields = metaimage_fields(h.first, h.volumes, h.compressed), last = "ElementDataFile = LOCAL\n";
    if (h.last_word) return fields + last;
    constexpr std::string_view comment = "Comment = ";
    std::size_t const used = fields.size() + last.size() + comment.size() + 1;
    std::size_t const length = h.length == 0 ? used + reserve : h.length;
    if (used > length) throw Error(ErrorKind::failure, "no room in the MetaImage header");
    return text(comment, std::string(length - used, '.'), "\n", fields, last);
}

std::string metaimage_text(HeaderText const& h) {
    if (h.data.empty()) return attached_header(h);
    return metaimage_fields(h.first, h.volumes, h.compressed) + text("ElementDataFile = ", h.data, "\n");
}

std::unique_ptr<Sink> create_metaimage(std::string const& path, WriteOptions const& options) {
    HeaderFormat format{"MetaImage",         ".mha",        ".mhd", ".raw", ".zraw", DeflateWriter::Wrapper::zlib, true,
                        metaimage_type_name, metaimage_text};
    return slab_sink(std::make_unique<HeaderAndVoxelsWriter>(std::move(format), path, options));
}

} // namespace

Format metaimage_format() {
    return {"metaimage",      "MetaImage, attached or detached (ITK, VTK)",
            {".mha", ".mhd"}, is_metaimage,
            open_metaimage,   create_metaimage};
}

} // namespace vkt
