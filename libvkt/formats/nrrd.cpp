// NRRD files: attached (.nrrd) and detached (.nhdr), read in every encoding, written raw or gzip.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/slab_sink.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace vkt {

namespace {

bool is_nrrd(std::span<std::byte const> head) { return head.size() >= 8 && std::memcmp(head.data(), "NRRD00", 6) == 0; }

std::unique_ptr<Source> open_nrrd(std::unique_ptr<ByteSource> bytes, ReadOptions const&) {
    RawLayout layout = nrrd_layout(read_nrrd_header(*bytes));
    return raw_source(std::move(bytes), std::move(layout));
}

std::string escaped(std::string const& s) {
    std::string result;
    for (char const c : s) {
        if (c == '\n')
            result += "\\n";
        else if (c == '\\')
            result += "\\\\";
        else
            result += c;
    }
    return result;
}

std::string one_line(std::string s) {
    for (char& c : s)
        if (c == '\n' || c == '\r') c = ' ';
    return s;
}

std::string vector_text(Vec3 v) { return text("(", v.x, ",", v.y, ",", v.z, ")"); }

/// Keys that the format cannot tell from something else are left out.
bool is_writable_key(std::string const& key) {
    return !key.empty() && key.front() != '#' && key.find(":=") == std::string::npos &&
           key.find('\r') == std::string::npos;
}

/// An attribute that lists one entry for each axis, if it still does; a fourth axis gets `extra`.
std::string axis_line(Header const& header, std::string const& field, bool series, std::string const& extra) {
    auto const found = header.attributes.find(field);
    if (found == header.attributes.end()) return {};
    bool const quoted = field == "labels" || field == "units" || field == "space units";
    std::string const line = one_line(found->second);
    auto const entries =
        quoted ? static_cast<std::int64_t>(std::count(line.begin(), line.end(), '"')) / 2 : std::ssize(words_of(line));
    if (entries != 3) return {};
    return text(field, ": ", line, series ? text(" ", extra) : "", "\n");
}

/// Escaped it may be twice as long, and stays a line that every reader takes.
constexpr std::size_t most_history = 400'000;

/// The header of a series of volumes, or of one; without the blank line at the end. `data_file` empty: attached.
std::string nrrd_header_text(Header const& header, std::int64_t volumes, bool gzip, std::string const& data_file) {
    Geometry const& g = header.geometry;
    bool const series = volumes > 1;
    auto const attribute = [&](std::string const& key) {
        auto const found = header.attributes.find(key);
        return found == header.attributes.end() ? std::string{} : one_line(found->second);
    };
    std::string const kind = attribute("sequence kind");
    std::string result;
    for (std::string const field : {"content", "old min", "old max"})
        if (auto const value = attribute(field); !value.empty()) result += text(field, ": ", value, "\n");
    result += text("type: ", nrrd_type_name(header.dtype), "\ndimension: ", series ? 4 : 3, "\n");
    std::string const space = attribute("space");
    result += space.empty() ? "space dimension: 3\n" : text("space: ", space, "\n");
    result += text("sizes: ", header.dims, series ? text(" ", volumes) : "", "\n");
    result += text("space directions: ", vector_text(g.direction[0] * g.spacing.x), " ",
                   vector_text(g.direction[1] * g.spacing.y), " ", vector_text(g.direction[2] * g.spacing.z),
                   series ? " none" : "", "\n");
    std::string const kinds = axis_line(header, "kinds", series, kind.empty() ? "list" : kind);
    result += kinds.empty()
                  ? text("kinds: domain domain domain", series ? text(" ", kind.empty() ? "list" : kind) : "", "\n")
                  : kinds;
    result += axis_line(header, "centers", series, "???");
    result += axis_line(header, "labels", series, "\"\"");
    result += text("endian: little\nencoding: ", gzip ? "gzip" : "raw", "\n");
    result += axis_line(header, "space units", false, "");
    result += text("space origin: ", vector_text(g.origin), "\n");
    if (auto const frame = attribute("measurement frame"); !frame.empty())
        result += text("measurement frame: ", frame, "\n");
    if (!header.units.empty()) result += text("sample units: \"", one_line(header.units), "\"\n");
    if (!data_file.empty()) result += text("data file: ", data_file, "\n");
    if (header.values != ValueMap{})
        result += text("vkt slope:=", header.values.slope, "\nvkt intercept:=", header.values.intercept, "\n");
    for (auto const& [key, value] : header.attributes)
        if (!is_nrrd_attribute(key) && is_writable_key(key)) result += text(escaped(key), ":=", escaped(value), "\n");
    if (header.history) result += text("vkt history:=", escaped(history_text(*header.history, most_history)), "\n");
    return result;
}

constexpr char const* remark = "# Complete NRRD file format specification at:\n"
                               "# http://teem.sourceforge.net/nrrd/format.html\n";

/// In an attached file the remark makes room: a series found out about later needs a longer header of equal length.
std::string whole_header(Header const& header, std::int64_t volumes, bool gzip, std::string const& data_file,
                         std::size_t length) {
    std::string const magic = header.attributes.count("measurement frame") ? "NRRD0005\n" : "NRRD0004\n";
    std::string const body = nrrd_header_text(header, volumes, gzip, data_file) + (data_file.empty() ? "\n" : "");
    if (length == 0) return magic + remark + body;
    std::size_t const used = magic.size() + body.size();
    if (used + 2 > length) throw Error(ErrorKind::failure, "no room in the NRRD header for a series");
    return text(magic, "#", std::string(length - used - 2, '.'), "\n", body);
}

std::string nrrd_text(HeaderText const& h) {
    return whole_header(h.first, h.volumes, h.compressed >= 0, h.data, h.length);
}

std::unique_ptr<Sink> create_nrrd(std::string const& path, WriteOptions const& options) {
    HeaderFormat format{"NRRD", ".nrrd",        ".nhdr",  ".raw", ".raw.gz", DeflateWriter::Wrapper::gzip,
                        false,  nrrd_type_name, nrrd_text};
    return slab_sink(std::make_unique<HeaderAndVoxelsWriter>(std::move(format), path, options));
}

} // namespace

Format nrrd_format() {
    return {"nrrd",     "NRRD, attached or detached (teem, ITK, 3D Slicer)", {".nrrd", ".nhdr"}, is_nrrd, open_nrrd,
            create_nrrd};
}

} // namespace vkt
