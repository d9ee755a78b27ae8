// NRRD files: attached (.nrrd) and detached (.nhdr), read in every encoding, written raw or gzip.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/segmentation.h"
#include "libvkt/formats/slab_sink.h"

#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace vkt {

namespace {

bool is_nrrd(std::span<std::byte const> head) { return head.size() >= 8 && std::memcmp(head.data(), "NRRD00", 6) == 0; }

std::unique_ptr<Source> open_nrrd(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    RawLayout layout = nrrd_layout(read_nrrd_header(*bytes), options.trust_paths);
    layout.notice = options.notice;
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

std::string vector_text(Vec3 v) { return text("(", v.x, ",", v.y, ",", v.z, ")"); }

/// Keys that the format cannot tell from something else.
bool is_writable_key(std::string const& key) {
    return !key.empty() && key.front() != '#' && key.find(":=") == std::string::npos &&
           key.find('\r') == std::string::npos;
}

/// The fields of one header. Attributes become the fields that they stand for as long as they fit there, and pairs
/// otherwise: nothing is left out.
class FieldWriter {
public:
    FieldWriter(Header const& header, std::int64_t volumes) : header_(header), series_(volumes > 1), volumes_(volumes) {
        if (!series_) return;
        auto const* const step = attribute("sequence step");
        auto const* const position = attribute("sequence position");
        std::optional<double> const along = step ? number_in(*step) : std::nullopt;
        origin_ = (position ? number_in(*position) : std::nullopt).value_or(0);
        if (along && *along != 0 && std::isfinite(*along) && std::isfinite(origin_)) step_ = along;
    }

    /// Without the blank line at the end. `data_file` empty: attached.
    std::string text_of(bool gzip, std::string const& data_file);

private:
    /// The attribute if it is one line; said_ remembers that it is written.
    std::string const* attribute(std::string const& key) const;
    std::string take(std::string const& key);
    void put_number(std::string const& field);
    void put_space();
    void put_axis_words(std::string const& field, std::string const& extra);
    void put_labels();
    void put_units();
    void put_frame();
    void put_pairs();
    std::string kind();

    Header const& header_;
    bool series_;
    std::int64_t volumes_;
    std::optional<double> step_; ///< along a fourth axis of the space; without it that axis is none of the space's
    double origin_ = 0;
    std::set<std::string> said_;
    std::string result_;
};

std::string const* FieldWriter::attribute(std::string const& key) const {
    auto const found = header_.attributes.find(key);
    bool const fits = found != header_.attributes.end() && found->second.find_first_of("\r\n") == std::string::npos;
    return fits && trimmed(found->second) == found->second && !found->second.empty() ? &found->second : nullptr;
}

std::string FieldWriter::take(std::string const& key) {
    auto const* const value = attribute(key);
    if (!value) return {};
    said_.insert(key);
    return *value;
}

void FieldWriter::put_number(std::string const& field) {
    if (auto const* const value = attribute(field); value && number_in(*value))
        result_ += text(field, ": ", take(field), "\n");
}

void FieldWriter::put_space() {
    auto const* const name = attribute("space");
    std::string const known = name ? nrrd_space(*name) : "";
    if (known.empty()) {
        result_ += text("space dimension: ", step_ ? 4 : 3, "\n");
    } else {
        said_.insert("space");
        result_ += text("space: ", known, step_ ? "-time" : "", "\n");
    }
}

/// An attribute that lists a word for each axis, if it still does; a fourth axis gets `extra`.
void FieldWriter::put_axis_words(std::string const& field, std::string const& extra) {
    auto const* const line = attribute(field);
    if (!line || words_of(*line).size() != 3) return;
    result_ += text(field, ": ", take(field), series_ ? " " + extra : "", "\n");
}

void FieldWriter::put_labels() {
    auto const* const line = attribute("labels");
    auto const entries = line ? quoted_entries(*line) : std::nullopt;
    std::string const last = series_ && attribute(sequence_label) ? take(sequence_label) : "\"\"";
    if (entries && entries->size() == 3)
        result_ += text("labels: ", take("labels"), series_ ? " " + last : "", "\n");
    else if (last != "\"\"")
        result_ += text("labels: \"\" \"\" \"\" ", last, "\n");
}

void FieldWriter::put_units() {
    auto const* const line = attribute("space units");
    auto const entries = line ? quoted_entries(*line) : std::nullopt;
    std::string const last = series_ && attribute(sequence_units) ? take(sequence_units) : "\"\"";
    bool const of_space = entries && entries->size() == 3;
    std::string const units = of_space ? take("space units") : "\"\" \"\" \"\"";
    if (of_space || (step_ && last != "\"\"")) result_ += text("space units: ", units, step_ ? " " + last : "", "\n");
    if (!step_ && last != "\"\"") result_ += text("units: \"\" \"\" \"\" ", last, "\n");
}

void FieldWriter::put_frame() {
    std::string frame = take("measurement frame");
    if (frame.empty()) return;
    if (step_) {
        for (std::size_t i = frame.find(')'); i != std::string::npos; i = frame.find(')', i + 3)) frame.insert(i, ",0");
        frame += " (0,0,0,1)";
    }
    result_ += text("measurement frame: ", frame, "\n");
}

/// Of the fourth axis.
std::string FieldWriter::kind() {
    std::string const said = take(sequence_kind);
    bool const of_space = said == "domain" || said == "space" || said == "time";
    if (step_) return of_space ? said : "domain";
    return said.empty() ? "list" : said;
}

/// Escaped it may be twice as long, and stays a line that every reader takes.
constexpr std::size_t most_history = 400'000;

void FieldWriter::put_pairs() {
    if (header_.values != ValueMap{})
        result_ += text("vkt slope:=", header_.values.slope, "\nvkt intercept:=", header_.values.intercept, "\n");
    std::map<std::string, std::string> others;
    for (auto const& [key, value] : header_.attributes) {
        if (said_.count(key)) continue;
        if (is_writable_key(key) && value.find('\r') == std::string::npos)
            result_ += text(escaped(key), ":=", escaped(value), "\n");
        else
            others.emplace(key, value);
    }
    if (!others.empty()) result_ += text("vkt attributes:=", escaped(attributes_text(others)), "\n");
    if (says_error(header_)) result_ += text("vkt error:=", escaped(to_json(header_.error)), "\n");
    if (header_.history) result_ += text("vkt history:=", escaped(history_text(*header_.history, most_history)), "\n");
}

std::string FieldWriter::text_of(bool gzip, std::string const& data_file) {
    Geometry const& g = header_.geometry;
    if (auto const content = take("content"); !content.empty()) result_ += text("content: ", content, "\n");
    put_number("old min");
    put_number("old max");
    result_ += text("type: ", nrrd_type_name(header_.dtype), "\ndimension: ", series_ ? 4 : 3, "\n");
    put_space();
    result_ += text("sizes: ", header_.dims, series_ ? text(" ", volumes_) : "", "\nspace directions:");
    for (int a = 0; a < 3; ++a) {
        std::string vector = vector_text(g.direction[static_cast<std::size_t>(a)] * g.spacing[a]);
        if (step_) vector.insert(vector.size() - 1, ",0");
        result_ += " " + vector;
    }
    if (series_) result_ += step_ ? text(" (0,0,0,", *step_, ")") : " none";
    result_ += "\n";
    std::string const last = series_ ? kind() : "";
    if (auto const* const kinds = attribute("kinds"); kinds && words_of(*kinds).size() == 3)
        put_axis_words("kinds", last);
    else
        result_ += text("kinds: domain domain domain", series_ ? " " + last : "", "\n");
    put_axis_words("centers", "???");
    put_axis_words("thicknesses", "nan");
    put_labels();
    result_ += text("endian: little\nencoding: ", gzip ? "gzip" : "raw", "\n");
    put_units();
    std::string origin = vector_text(g.origin);
    if (step_) origin.insert(origin.size() - 1, text(",", origin_));
    result_ += text("space origin: ", origin, "\n");
    put_frame();
    if (!header_.units.empty()) result_ += text("sample units: \"", one_line(header_.units), "\"\n");
    if (!data_file.empty()) result_ += text("data file: ", data_file, "\n");
    if (step_) said_.insert({"sequence step", "sequence position"});
    put_pairs();
    return result_;
}

constexpr char const* remark = "# Complete NRRD file format specification at:\n"
                               "# http://teem.sourceforge.net/nrrd/format.html\n";

/// In an attached file the remark makes room: a series found out about later needs a longer header of equal length.
std::string whole_header(Header const& header, std::int64_t volumes, bool gzip, std::string const& data_file,
                         std::size_t length) {
    std::string const magic = header.attributes.count("measurement frame") ? "NRRD0005\n" : "NRRD0004\n";
    std::string const body = FieldWriter(header, volumes).text_of(gzip, data_file) + (data_file.empty() ? "\n" : "");
    if (length == 0) return magic + remark + body;
    std::size_t const used = magic.size() + body.size();
    if (used + 2 > length) throw Error(ErrorKind::failure, "no room in the NRRD header for a series");
    return text(magic, "#", std::string(length - used - 2, '.'), "\n", body);
}

std::string nrrd_text(HeaderText const& h) {
    return whole_header(h.first, h.volumes, h.compressed >= 0, h.data, h.length);
}

std::string segmentation_text(Header const& header, bool gzip) { return whole_header(header, 1, gzip, "", 0); }

std::unique_ptr<Sink> create_nrrd(std::string const& path, WriteOptions const& options) {
    if (is_segmentation_name(path)) return slab_sink(segmentation_writer(path, options, segmentation_text));
    HeaderFormat format{"NRRD", ".nrrd",        ".nhdr",   ".raw", ".raw.gz", DeflateWriter::Wrapper::gzip,
                        false,  nrrd_type_name, nrrd_text, true};
    return slab_sink(std::make_unique<HeaderAndVoxelsWriter>(std::move(format), path, options));
}

} // namespace

Format nrrd_format() {
    return {"nrrd",
            "NRRD, attached or detached (teem, ITK, 3D Slicer)",
            {".nrrd", ".nhdr"},
            is_nrrd,
            open_nrrd,
            create_nrrd,
            true};
}

} // namespace vkt
