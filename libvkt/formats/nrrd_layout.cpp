// What NRRD headers mean: axes, geometry, encodings, files.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"

#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace vkt {

namespace {

constexpr std::int64_t most_axes = 16;

struct TypeName {
    char const* name;
    DataType type;
};
/// The first name of each type is the one that is written.
constexpr std::array type_names{
    TypeName{"unsigned char", DataType::uint8},
    TypeName{"uchar", DataType::uint8},
    TypeName{"uint8", DataType::uint8},
    TypeName{"uint8_t", DataType::uint8},
    TypeName{"signed char", DataType::int8},
    TypeName{"int8", DataType::int8},
    TypeName{"int8_t", DataType::int8},
    TypeName{"char", DataType::int8},
    TypeName{"unsigned short", DataType::uint16},
    TypeName{"ushort", DataType::uint16},
    TypeName{"unsigned short int", DataType::uint16},
    TypeName{"uint16", DataType::uint16},
    TypeName{"uint16_t", DataType::uint16},
    TypeName{"short", DataType::int16},
    TypeName{"short int", DataType::int16},
    TypeName{"signed short", DataType::int16},
    TypeName{"signed short int", DataType::int16},
    TypeName{"int16", DataType::int16},
    TypeName{"int16_t", DataType::int16},
    TypeName{"unsigned int", DataType::uint32},
    TypeName{"uint", DataType::uint32},
    TypeName{"uint32", DataType::uint32},
    TypeName{"uint32_t", DataType::uint32},
    TypeName{"int", DataType::int32},
    TypeName{"signed int", DataType::int32},
    TypeName{"int32", DataType::int32},
    TypeName{"int32_t", DataType::int32},
    TypeName{"unsigned long long", DataType::uint64},
    TypeName{"ulonglong", DataType::uint64},
    TypeName{"unsigned long long int", DataType::uint64},
    TypeName{"uint64", DataType::uint64},
    TypeName{"uint64_t", DataType::uint64},
    TypeName{"long long", DataType::int64},
    TypeName{"longlong", DataType::int64},
    TypeName{"long long int", DataType::int64},
    TypeName{"signed long long", DataType::int64},
    TypeName{"signed long long int", DataType::int64},
    TypeName{"int64", DataType::int64},
    TypeName{"int64_t", DataType::int64},
    TypeName{"float", DataType::float32},
    TypeName{"double", DataType::float64},
};

constexpr std::array kept_fields{"content", "old min", "old max", "measurement frame", "space units"};
constexpr std::array kept_axis_fields{"kinds", "labels", "centers", "units", "thicknesses"};

/// One entry of "(a,b,c) none (d,e,f)"; nullopt for none.
using MaybeVector = std::optional<std::vector<double>>;

class Interpreter {
public:
    explicit Interpreter(NrrdHeader const& header) : header_(header) {}
    RawLayout layout();

private:
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", header_.name, "': ", what), hint);
    }
    std::string const& needed(std::string const& field) const {
        if (!header_.has(field)) fail(text("NRRD field '", field, "' is missing"));
        return header_[field];
    }
    std::int64_t integer(std::string const& word, std::string const& field) const {
        auto const value = integer_in(word);
        if (!value) fail(text("'", field, ": ", word.substr(0, 40), "' is no integer"));
        return *value;
    }
    std::vector<std::string> axis_words(std::string const& field) const;
    std::vector<std::string> axis_quoted(std::string const& field) const;
    std::vector<double> axis_numbers(std::string const& field) const;
    std::vector<MaybeVector> vectors(std::string const& field) const;

    void read_axes();
    bool spatial(std::size_t axis) const;
    void choose_axes(RawLayout& layout);
    [[noreturn]] void refuse_samples(std::size_t axis) const;
    DataType type() const;
    void read_encoding(RawLayout& layout) const;
    void read_files(RawLayout& layout) const;
    Vec3 space_vector(std::vector<double> const& v) const;
    void read_geometry(Header& volume) const;
    void read_origin(Header& volume) const;
    double spacing_from_ends(std::size_t axis) const;
    double first_sample(std::size_t axis, double spacing) const;
    void read_attributes(RawLayout& layout) const;

    NrrdHeader const& header_;
    std::vector<std::int64_t> sizes_;
    std::vector<std::string> kinds_, centers_;
    std::vector<MaybeVector> directions_;
    std::vector<std::size_t> chosen_;     ///< file axes that become x, y, z
    std::optional<std::size_t> sequence_; ///< file axis that enumerates volumes
};

/// One word for each axis; empty if the field is absent.
std::vector<std::string> Interpreter::axis_words(std::string const& field) const {
    if (!header_.has(field)) return {};
    auto words = words_of(header_[field]);
    if (words.size() != sizes_.size())
        fail(text("'", field, "' has ", static_cast<std::int64_t>(words.size()), " entries for ",
                  static_cast<std::int64_t>(sizes_.size()), " axes"));
    return words;
}

/// One "quoted" entry for each axis, quotes included.
std::vector<std::string> Interpreter::axis_quoted(std::string const& field) const {
    std::vector<std::string> entries;
    std::string_view rest = header_[field];
    while (!(rest = trimmed(rest)).empty()) {
        if (rest.front() != '"') fail(text("'", field, "' has an entry without quotes"));
        std::size_t end = 1;
        while (end < rest.size() && rest[end] != '"') end += rest[end] == '\\' ? 2 : 1;
        if (end >= rest.size()) fail(text("'", field, "' has an open quote"));
        entries.emplace_back(rest.substr(0, end + 1));
        rest.remove_prefix(end + 1);
    }
    return entries;
}

std::vector<double> Interpreter::axis_numbers(std::string const& field) const {
    std::vector<double> values;
    for (auto const& word : axis_words(field)) {
        auto const value = number_in(word);
        if (!value) fail(text("'", field, "' has '", word.substr(0, 40), "', which is no number"));
        values.push_back(*value);
    }
    return values;
}

std::vector<MaybeVector> Interpreter::vectors(std::string const& field) const {
    std::vector<MaybeVector> result;
    std::string_view rest = header_[field];
    while (!(rest = trimmed(rest)).empty()) {
        if (lower_case(rest.substr(0, 4)) == "none") {
            result.emplace_back();
            rest.remove_prefix(4);
            continue;
        }
        std::size_t const end = rest.find(')');
        if (rest.front() != '(' || end == std::string_view::npos) fail(text("'", field, "' is no list of vectors"));
        std::vector<double> v;
        bool known = true;
        for (auto const& word : split(rest.substr(1, end - 1), ',')) {
            auto const value = number_in(trimmed(word));
            if (!value) fail(text("'", field, "' has '", word.substr(0, 40), "', which is no number"));
            known = known && !std::isnan(*value);
            v.push_back(*value);
        }
        // A vector of not-a-number is an older way to say none.
        result.push_back(known ? MaybeVector(std::move(v)) : std::nullopt);
        rest.remove_prefix(end + 1);
    }
    return result;
}

void Interpreter::read_axes() {
    std::int64_t const dimension = integer(needed("dimension"), "dimension");
    if (dimension < 1 || dimension > most_axes)
        fail(text("dimension ", dimension, " is not between 1 and ", most_axes));
    auto const words = words_of(needed("sizes"));
    if (std::ssize(words) != dimension)
        fail(text("'sizes' has ", static_cast<std::int64_t>(words.size()), " entries for ", dimension, " axes"));
    for (auto const& word : words) {
        sizes_.push_back(integer(word, "sizes"));
        if (sizes_.back() < 1 || sizes_.back() > max_extent) fail(text("size ", word, " is not between 1 and 2^40"));
    }
    kinds_ = axis_words("kinds");
    for (auto& kind : kinds_) kind = lower_case(kind);
    centers_ = axis_words("centers");
    directions_ = vectors("space directions");
    if (header_.has("space directions") && directions_.size() != sizes_.size())
        fail(text("'space directions' has ", static_cast<std::int64_t>(directions_.size()), " entries for ", dimension,
                  " axes"));
}

/// What the kinds and directions say; unknown counts as spatial.
bool Interpreter::spatial(std::size_t axis) const {
    if (!directions_.empty() && !directions_[axis]) return false;
    if (kinds_.empty()) return true;
    std::string const& kind = kinds_[axis];
    return kind == "domain" || kind == "space" || kind == "???" || kind == "none";
}

void Interpreter::refuse_samples(std::size_t axis) const {
    std::string order;
    for (std::size_t i = 0; i < sizes_.size(); ++i)
        if (i != axis) order += text(static_cast<std::int64_t>(i), " ");
    fail(text("axis ", static_cast<std::int64_t>(axis), " holds ", sizes_[axis], " values for each voxel",
              kinds_.empty() ? "" : text(" (", kinds_[axis], ")"), "; a volume has one"),
         text("take one: unu slice -a ", static_cast<std::int64_t>(axis),
              " -p 0, or make it a sequence: unu permute -p ", order, static_cast<std::int64_t>(axis)));
}

void Interpreter::choose_axes(RawLayout& layout) {
    for (std::size_t i = 0; i < sizes_.size(); ++i)
        if (spatial(i) || sizes_[i] > 1) chosen_.push_back(i);
    // More axes than a series has: those of one sample say nothing.
    for (std::size_t i = chosen_.size(); i-- > 0 && chosen_.size() > 4;)
        if (sizes_[chosen_[i]] == 1) chosen_.erase(chosen_.begin() + static_cast<std::ptrdiff_t>(i));
    // Nor does a first of four, which older writers give to scalars.
    if (chosen_.size() == 4 && sizes_[chosen_[0]] == 1 && spatial(chosen_[3])) chosen_.erase(chosen_.begin());
    // The fourth axis enumerates volumes. With fewer, a last axis that is a list or time is as good as z.
    if (chosen_.size() == 4 && (spatial(chosen_[0]) || !spatial(chosen_[3]))) {
        sequence_ = chosen_.back();
        chosen_.pop_back();
    }
    for (std::size_t i = 0; i < chosen_.size(); ++i)
        if (!spatial(chosen_[i]) && !(i > 0 && i + 1 == chosen_.size() && !sequence_)) refuse_samples(chosen_[i]);
    if (chosen_.size() > 3)
        fail(text("it has ", static_cast<std::int64_t>(chosen_.size()), " axes; at most four make volumes"),
             "take a slice: unu slice -a AXIS -p POSITION");
    for (std::size_t i = 0; i < chosen_.size(); ++i) layout.header.dims[static_cast<int>(i)] = sizes_[chosen_[i]];
    if (sequence_) layout.volumes = sizes_[*sequence_];
}

DataType Interpreter::type() const {
    std::string const word = lower_case(needed("type"));
    for (auto const& entry : type_names)
        if (word == entry.name) return entry.type;
    fail(text("type '", word.substr(0, 40), "' is not supported"));
}

void Interpreter::read_encoding(RawLayout& layout) const {
    std::string const word = lower_case(needed("encoding"));
    if (word == "raw")
        layout.encoding = Encoding::raw;
    else if (word == "gzip" || word == "gz")
        layout.encoding = Encoding::deflate;
    else if (word == "bzip2" || word == "bz2")
        layout.encoding = Encoding::bzip2;
    else if (word == "hex")
        layout.encoding = Encoding::hex;
    else if (word == "text" || word == "txt" || word == "ascii")
        layout.encoding = Encoding::text;
    else
        fail(text("encoding '", word.substr(0, 40), "' is not supported"));
    std::string const endian = lower_case(header_["endian"]);
    if (endian == "big")
        layout.big_endian = true;
    else if (!endian.empty() && endian != "little")
        fail(text("'endian: ", endian.substr(0, 40), "' is neither little nor big"));
    else if (endian.empty() && size_of(layout.header.dtype) > 1 && layout.encoding != Encoding::text)
        fail("NRRD field 'endian' is missing", "add the line 'endian: little' to the header, or 'endian: big'");
    if (header_.has("line skip")) layout.line_skip = integer(header_["line skip"], "line skip");
    if (header_.has("byte skip")) layout.byte_skip = integer(header_["byte skip"], "byte skip");
    if (layout.line_skip < 0 || layout.byte_skip < -1) fail("a negative skip");
}

/// "LIST [subdim]", "pattern first last step [subdim]" or a name.
void Interpreter::read_files(RawLayout& layout) const {
    if (!header_.has("data file")) return;
    std::string const& field = header_["data file"];
    auto const words = words_of(field);
    std::string dimension;
    if (!words.empty() && words[0] == "LIST") {
        layout.files = header_.listed_files;
        if (words.size() > 1) dimension = words[1];
        if (layout.files.empty()) fail("'data file: LIST' without files");
    } else if (words.size() >= 4 && is_numbered(words[0])) {
        layout.files = numbered_files(words[0], integer(words[1], "data file"), integer(words[2], "data file"),
                                      integer(words[3], "data file"));
        if (words.size() > 4) dimension = words[4];
    } else {
        if (field.empty()) fail("'data file' names no file");
        layout.files = {field};
    }
    if (!dimension.empty()) {
        std::int64_t const axes = integer(dimension, "data file");
        if (axes < 1 || axes > std::ssize(sizes_)) fail(text("data files of dimension ", axes));
        std::int64_t pieces = 1;
        for (std::size_t i = static_cast<std::size_t>(axes); i < sizes_.size(); ++i)
            if (__builtin_mul_overflow(pieces, sizes_[i], &pieces)) fail("sizes overflow");
        if (axes < std::ssize(sizes_) && pieces != std::ssize(layout.files))
            fail(text(pieces, " data files of dimension ", axes, " needed, ",
                      static_cast<std::int64_t>(layout.files.size()), " named"));
    }
    for (auto& file : layout.files) file = beside(header_.name, file);
}

Vec3 Interpreter::space_vector(std::vector<double> const& v) const {
    // A fourth component is time, which the sequence has.
    if (v.empty() || v.size() > 4) fail("vectors of space need one to four components");
    Vec3 result;
    for (std::size_t i = 0; i < std::min<std::size_t>(v.size(), 3); ++i) result[static_cast<int>(i)] = v[i];
    return result;
}

/// From "axis mins" and "axis maxs" alone; 1 if they say nothing.
double Interpreter::spacing_from_ends(std::size_t axis) const {
    auto const lowest = axis_numbers("axis mins"), highest = axis_numbers("axis maxs");
    if (lowest.empty() || highest.empty()) return 1;
    bool const node = !centers_.empty() && centers_[axis] == "node";
    double const intervals = static_cast<double>(sizes_[axis]) - (node ? 1 : 0);
    double const spacing = (highest[axis] - lowest[axis]) / intervals;
    return std::isfinite(spacing) && spacing != 0 ? spacing : 1;
}

/// "axis mins" is where the first cell begins, or the first sample itself when samples are nodes.
double Interpreter::first_sample(std::size_t axis, double spacing) const {
    auto const lowest = axis_numbers("axis mins");
    if (lowest.empty() || std::isnan(lowest[axis])) return 0;
    bool const node = !centers_.empty() && centers_[axis] == "node";
    return lowest[axis] + (node ? 0 : 0.5 * spacing);
}

void Interpreter::read_geometry(Header& volume) const {
    Geometry& geometry = volume.geometry;
    auto const spacings = axis_numbers("spacings");
    int known = 0;
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
        std::size_t const axis = chosen_[i];
        int const a = static_cast<int>(i);
        if (!directions_.empty() && directions_[axis]) {
            set_axis(geometry, a, space_vector(*directions_[axis]), text("'", header_.name, "': the space direction"));
            known = a + 1;
            continue;
        }
        if (!directions_.empty()) break; // the last axis may be a list: it becomes perpendicular to the others
        double const spacing =
            spacings.empty() || std::isnan(spacings[axis]) ? spacing_from_ends(axis) : spacings[axis];
        Vec3 along;
        along[a] = spacing;
        set_axis(geometry, a, along, text("'", header_.name, "': the spacing"));
        if (!header_.has("space origin")) geometry.origin[a] = first_sample(axis, spacing);
        known = a + 1;
    }
    complete_directions(geometry, known);
    read_origin(volume);
}

void Interpreter::read_origin(Header& volume) const {
    if (!header_.has("space origin")) return;
    auto const origin = vectors("space origin");
    if (origin.size() != 1) fail("'space origin' is not one vector");
    if (origin[0]) volume.geometry.origin = space_vector(*origin[0]);
}

void Interpreter::read_attributes(RawLayout& layout) const {
    Header& volume = layout.header;
    auto& attributes = volume.attributes;
    attributes = header_.pairs;
    std::string const space = frame_name(header_["space"]);
    if (!space.empty()) attributes["space"] = space;
    for (std::string const field : kept_fields)
        if (header_.has(field)) attributes[field] = header_[field];
    for (std::string const field : kept_axis_fields) {
        if (!header_.has(field)) continue;
        bool const quoted = field == "labels" || field == "units";
        auto const entries = quoted ? axis_quoted(field) : axis_words(field);
        if (entries.size() < sizes_.size()) fail(text("'", field, "' has too few entries"));
        std::vector<std::string> kept;
        bool plain = field == "kinds";
        for (std::size_t const axis : chosen_) {
            kept.push_back(entries[axis]);
            plain = plain && spatial(axis);
        }
        if (!plain) attributes[field] = join(kept, " ");
    }
    if (sequence_ && !kinds_.empty() && kinds_[*sequence_] != "list") attributes["sequence kind"] = kinds_[*sequence_];
    volume.units = header_["sample units"];
    if (volume.units.size() >= 2 && volume.units.front() == '"' && volume.units.back() == '"')
        volume.units = volume.units.substr(1, volume.units.size() - 2);
    auto const take_number = [&](std::string const& key, double& target) {
        auto const found = attributes.find(key);
        if (found == attributes.end()) return;
        auto const value = number_in(trimmed(found->second));
        if (!value) fail(text("'", key, "' is no number"));
        target = *value;
        attributes.erase(found);
    };
    take_number("vkt slope", volume.values.slope);
    take_number("vkt intercept", volume.values.intercept);
    if (auto const found = attributes.find("vkt history"); found != attributes.end()) {
        volume.history = parse_history(found->second);
        if (volume.history) attributes.erase(found);
    }
}

RawLayout Interpreter::layout() {
    RawLayout layout;
    read_axes();
    choose_axes(layout);
    layout.header.dtype = type();
    read_encoding(layout);
    read_files(layout);
    read_geometry(layout.header);
    read_attributes(layout);
    return layout;
}

} // namespace

RawLayout nrrd_layout(NrrdHeader const& header) { return Interpreter(header).layout(); }

std::string nrrd_type_name(DataType type) {
    for (auto const& entry : type_names)
        if (entry.type == type) return entry.name;
    return {};
}

bool is_nrrd_attribute(std::string const& key) {
    if (key == "space" || key == "sequence kind") return true;
    for (std::string const field : kept_fields)
        if (key == field) return true;
    for (std::string const field : kept_axis_fields)
        if (key == field) return true;
    return false;
}

} // namespace vkt
