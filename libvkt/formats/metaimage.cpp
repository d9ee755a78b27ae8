// MetaImage files: .mha with the voxels inside and .mhd beside a .raw or .zraw, as ITK and VTK write them.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/metaimage_header.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/slab_sink.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

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

std::unique_ptr<Source> open_metaimage(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    RawLayout layout = metaimage_layout(read_metaimage_header(*bytes), options.trust_paths);
    layout.notice = options.notice;
    return raw_source(std::move(bytes), std::move(layout));
}

Vec3 turned(Vec3 v, Vec3 signs) { return {v.x * signs.x + 0.0, v.y * signs.y + 0.0, v.z * signs.z + 0.0}; }

/// Where the axes of the header's world point in left-posterior-superior coordinates.
Vec3 signs_in_lps(Header const& header) {
    Header unit;
    unit.attributes = header.attributes;
    unit.geometry.origin = {1, 1, 1};
    return geometry_in(lps_frame, unit).origin;
}

/// A measurement frame, which lies in the same world: "(a,b,c) (d,e,f) (g,h,i)". Empty if it is none.
std::string turned_frame(std::string frame, Vec3 signs) {
    for (char& c : frame)
        if (c == '(' || c == ')' || c == ',') c = ' ';
    std::vector<double> numbers;
    for (auto const& word : words_of(frame))
        if (auto const number = number_in(word)) numbers.push_back(*number);
    if (numbers.size() != 9) return {};
    std::string result;
    for (std::size_t i = 0; i < 9; i += 3) {
        Vec3 const v = turned({numbers[i], numbers[i + 1], numbers[i + 2]}, signs);
        result += text(i > 0 ? " " : "", "(", v.x, ",", v.y, ",", v.z, ")");
    }
    return result;
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

/// Only what MetaIO's own parser reads as a field goes into the file as one.
bool is_writable_key(std::string const& key) {
    return !key.empty() && !is_metaimage_field(key) && std::all_of(key.begin(), key.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    });
}

/// MetaIO's name of the unit that all three axes have; empty if it has none.
std::string distance_unit(Header const& header) {
    auto const found = header.attributes.find("space units");
    auto const entries = found == header.attributes.end() ? std::nullopt : quoted_entries(found->second);
    if (!entries || entries->size() != 3) return {};
    for (char const* const unit : {"um", "mm", "cm"})
        if (std::all_of(entries->begin(), entries->end(), [&](auto const& e) { return e == text("\"", unit, "\""); }))
            return unit;
    return {};
}

/// Where volumes lie along the fourth axis, as numbers that MetaIO takes; by default those of a file that does not say.
struct Sequence {
    explicit Sequence(Header const& header) {
        auto const number = [&](char const* key) {
            auto const found = header.attributes.find(key);
            return found == header.attributes.end() ? std::nullopt : number_in(found->second);
        };
        auto const said = number("sequence step"), position = number("sequence position");
        known = said && *said != 0 && std::isfinite(*said) && (!position || std::isfinite(*position));
        if (!known) return;
        step = *said;
        origin = position.value_or(0);
    }
    bool known;
    double step = 1, origin = 0;
};

/// Attributes as fields of their own where their names and values can be, the others together.
std::string attribute_fields(Header const& header, bool in_series, std::string const& unit) {
    std::string result;
    std::map<std::string, std::string> others;
    for (auto const& [key, value] : header.attributes) {
        bool const said = key == "Comment" || (key == "space" && is_anatomical(frame_of(header))) ||
                          (key == "space units" && !unit.empty()) ||
                          (in_series && (key == "sequence step" || key == "sequence position"));
        if (said) continue;
        if (key == "measurement frame") {
            std::string const frame = turned_frame(value, signs_in_lps(header));
            if (!frame.empty()) others.emplace(key, frame);
            continue;
        }
        bool const plain = !value.empty() && trimmed(value) == value && one_line(value) == value;
        if (key == "space" && plain)
            result += text("VktSpace = ", value, "\n");
        else if (plain && is_writable_key(key))
            result += text(key, " = ", value, "\n");
        else
            others.emplace(key, value);
    }
    if (!others.empty()) result += text("VktAttributes = ", attributes_text(others), "\n");
    return result;
}

/// ITK and VTK give up on lines of 32 KiB and more.
constexpr std::size_t most_history = 32'000;

/// Everything before ElementDataFile. `compressed` < 0: not compressed.
std::string metaimage_fields(Header const& header, std::int64_t volumes, std::int64_t compressed) {
    bool const series = volumes > 1;
    std::string const frame = frame_of(header);
    Geometry const g = geometry_in(lps_frame, header); // where every anatomical MetaImage lies
    Sequence const along(header);
    std::string const unit = distance_unit(header);
    std::string result =
        text("ObjectType = Image\nNDims = ", series ? 4 : 3, "\nBinaryData = True\nBinaryDataByteOrderMSB = False\n");
    result += text("CompressedData = ", compressed < 0 ? "False" : "True", "\n");
    if (compressed >= 0) result += text("CompressedDataSize = ", compressed, "\n");
    result += "TransformMatrix =";
    for (auto const& d : g.direction) result += text(" ", d, series ? " 0" : "");
    // The sign of the step is its direction.
    result += series ? text(" 0 0 0 ", along.step < 0 ? -1 : 1, "\n") : "\n";
    result += text("Offset = ", g.origin, series ? text(" ", along.origin) : "", "\nCenterOfRotation = 0 0 0",
                   series ? " 0" : "", "\n");
    if (is_anatomical(frame)) result += text("AnatomicalOrientation = ", orientation(g), "\n");
    if (!unit.empty()) result += text("DistanceUnits = ", unit, "\n");
    result += text("ElementSpacing = ", g.spacing, series ? text(" ", std::abs(along.step)) : "",
                   "\nDimSize = ", header.dims, series ? text(" ", volumes) : "", "\n");
    if (header.values != ValueMap{})
        result += text("ElementToIntensityFunctionSlope = ", header.values.slope,
                       "\nElementToIntensityFunctionOffset = ", header.values.intercept, "\n");
    if (series && !along.known) result += text(unknown_sequence, " = unknown\n");
    if (!header.units.empty()) result += text("VktUnits = ", one_line(header.units), "\n");
    result += attribute_fields(header, series && along.known, unit);
    if (says_error(header)) result += text("VktError = ", one_line(to_json(header.error)), "\n");
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
    HeaderFormat format{
        "MetaImage",         ".mha",         ".mhd", ".raw", ".zraw", DeflateWriter::Wrapper::zlib, true,
        metaimage_type_name, metaimage_text, true};
    return slab_sink(std::make_unique<HeaderAndVoxelsWriter>(std::move(format), path, options));
}

} // namespace

Format metaimage_format() {
    return {"metaimage",
            "MetaImage, attached or detached (ITK, VTK)",
            {".mha", ".mhd"},
            is_metaimage,
            open_metaimage,
            create_metaimage,
            true};
}

} // namespace vkt
