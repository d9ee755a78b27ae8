// What NRRD headers mean: axes, geometry, encodings, files.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
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

/// All of them exist with time as well.
constexpr std::array nrrd_spaces{"right-anterior-superior", "left-anterior-superior",
                                 "left-posterior-superior", "scanner-xyz",
                                 "3d-right-handed",         "3d-left-handed"};

constexpr std::array kept_fields{"content", "old min", "old max"};
/// What an axis that the file does not have is given in fields that list axes.
constexpr std::array<std::pair<char const*, char const*>, 4> kept_axis_fields{
    {{"kinds", "domain"}, {"labels", "\"\""}, {"centers", "???"}, {"thicknesses", "nan"}}};

/// One entry of "(a,b,c) none (d,e,f)"; nullopt for none.
using MaybeVector = std::optional<std::vector<double>>;

/// Kinds whose samples are positions, of space or of anything else, or that say nothing; all others are the components
/// of one value.
bool enumerates(std::string_view kind) {
    return kind == "domain" || kind == "space" || kind == "time" || kind == "list" || kind == "???" || kind == "none";
}

class Interpreter {
public:
    Interpreter(NrrdHeader const& header, bool trust_paths) : header_(header), trust_paths_(trust_paths) {}
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
    bool holds_samples(std::size_t axis) const;
    bool is_placeholder(std::size_t axis) const;
    void choose_axes(RawLayout& layout);
    [[noreturn]] void refuse_samples(std::size_t axis) const;
    DataType type() const;
    void read_encoding(RawLayout& layout) const;
    void read_files(RawLayout& layout) const;
    Vec3 space_vector(std::vector<double> const& v) const;
    void read_geometry(Header& volume) const;
    void read_origin(Header& volume) const;
    /// The axis that attributes of a series speak of.
    std::optional<std::size_t> series_axis() const { return sequence_ ? sequence_ : components_; }
    std::optional<SequenceAxis> along(std::size_t axis) const;
    std::optional<double> spacing_of(std::size_t axis) const;
    double first_sample(std::size_t axis, double spacing) const;
    void read_attributes(RawLayout& layout) const;
    void read_axis_attributes(std::map<std::string, std::string>& attributes) const;
    void read_space_units(std::map<std::string, std::string>& attributes) const;
    void read_frame(std::map<std::string, std::string>& attributes) const;

    NrrdHeader const& header_;
    bool trust_paths_;
    std::vector<std::int64_t> sizes_;
    std::vector<std::string> kinds_, centers_;
    std::vector<MaybeVector> directions_;
    std::vector<std::size_t> chosen_;       ///< file axes that become x, y, z
    std::optional<std::size_t> sequence_;   ///< file axis that enumerates volumes
    std::optional<std::size_t> components_; ///< file axis of what stands side by side in a voxel
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

/// One "quoted" entry for each axis, quotes included; empty if the field is absent.
std::vector<std::string> Interpreter::axis_quoted(std::string const& field) const {
    if (!header_.has(field)) return {};
    auto entries = quoted_entries(header_[field]);
    if (!entries) fail(text("'", field, "' has an entry without quotes, or an open quote"));
    return *entries;
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
    // teem writes "none" for every axis of a volume that has a space but only spacings: that is no more than silence.
    if (std::none_of(directions_.begin(), directions_.end(), [](MaybeVector const& v) { return v.has_value(); }))
        directions_.clear();
}

/// What the kinds and directions say; unknown counts as spatial.
bool Interpreter::spatial(std::size_t axis) const {
    if (!directions_.empty() && !directions_[axis]) return false;
    if (kinds_.empty()) return true;
    std::string const& kind = kinds_[axis];
    return kind == "domain" || kind == "space" || kind == "???" || kind == "none";
}

/// The samples along the axis are the components of one value, which several volumes are not.
bool Interpreter::holds_samples(std::size_t axis) const {
    return sizes_[axis] > 1 && !kinds_.empty() && !enumerates(kinds_[axis]);
}

/// An axis of one sample that stands where a slice was taken out.
bool Interpreter::is_placeholder(std::size_t axis) const {
    return sizes_[axis] == 1 && (kinds_.empty() || kinds_[axis] == "stub" || enumerates(kinds_[axis]));
}

void Interpreter::refuse_samples(std::size_t axis) const {
    auto const last = std::ssize(sizes_) - 1, here = static_cast<std::int64_t>(axis);
    // What comes last and is called a list is a sequence.
    std::string how = text("unu axinfo -a ", last, " -k list");
    if (here != last) {
        std::string order;
        for (std::int64_t i = 0; i <= last; ++i)
            if (i != here) order += text(i, " ");
        how = text("unu permute -p ", order, here, " | ", how);
    }
    fail(text("axis ", here, " holds ", sizes_[axis], " values for each voxel",
              kinds_.empty() ? "" : text(" (", kinds_[axis], ")"), "; a volume has one"),
         text("take one: unu slice -a ", here, " -p 0, or make it a sequence: ", how));
}

void Interpreter::choose_axes(RawLayout& layout) {
    bool const few = sizes_.size() <= 3; // each can keep its place
    for (std::size_t i = 0; i < sizes_.size(); ++i)
        if (spatial(i) || sizes_[i] > 1 || (few && is_placeholder(i))) chosen_.push_back(i);
    // More axes than a series has: those of one sample say nothing.
    for (std::size_t i = chosen_.size(); i-- > 0 && chosen_.size() > 4;)
        if (sizes_[chosen_[i]] == 1) chosen_.erase(chosen_.begin() + static_cast<std::ptrdiff_t>(i));
    // Nor does a first of four, which older writers give to scalars.
    bool const unexplained = kinds_.empty() && directions_.empty();
    if (chosen_.size() == 4 && sizes_[chosen_[0]] == 1 && unexplained) chosen_.erase(chosen_.begin());
    // What stands side by side in a voxel. Where nothing else is said, spacings tell what is space, and so do the kinds
    // of all the others.
    auto const of_space = [&](std::size_t axis) { return kinds_[axis] == "domain" || kinds_[axis] == "space"; };
    bool const four = chosen_.size() == 4,
               spaced = four && unexplained && !spacing_of(chosen_[0]) && spacing_of(chosen_[3]);
    bool const odd =
        four && !kinds_.empty() && !of_space(chosen_[0]) && std::all_of(chosen_.begin() + 1, chosen_.end(), of_space);
    bool const beside = chosen_.size() > 1 && !spatial(chosen_[0]);
    if (spaced || ((odd || beside) && sizes_[chosen_[0]] > 1)) {
        components_ = chosen_.front();
        chosen_.erase(chosen_.begin());
    }
    // The fourth axis enumerates volumes. With fewer, a last axis that is a list or time is as good as z.
    if (chosen_.size() == 4 || (chosen_.size() > 1 && holds_samples(chosen_.back()))) {
        sequence_ = chosen_.back();
        chosen_.pop_back();
    }
    for (std::size_t i = 0; i < chosen_.size(); ++i)
        if (!spatial(chosen_[i]) && sizes_[chosen_[i]] > 1 && !(i > 0 && i + 1 == chosen_.size() && !sequence_))
            refuse_samples(chosen_[i]);
    if (chosen_.size() > 3)
        fail(text("it has ", std::ssize(sizes_), " axes; at most three, and two that enumerate volumes, are read"),
             "take a slice: unu slice -a AXIS -p POSITION");
    for (std::size_t i = 0; i < chosen_.size(); ++i) layout.header.dims[static_cast<int>(i)] = sizes_[chosen_[i]];
    if (sequence_) layout.volumes = sizes_[*sequence_];
    if (components_) layout.components.count = sizes_[*components_];
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
    for (auto& file : layout.files) file = beside(header_.name, file, trust_paths_);
}

Vec3 Interpreter::space_vector(std::vector<double> const& v) const {
    if (v.empty() || v.size() > 4) fail("vectors of space need one to four components");
    Vec3 result;
    for (std::size_t i = 0; i < std::min<std::size_t>(v.size(), 3); ++i) result[static_cast<int>(i)] = v[i];
    return result;
}

/// What the axis' own fields say: its spacing, or else its ends.
std::optional<double> Interpreter::spacing_of(std::size_t axis) const {
    auto const spacings = axis_numbers("spacings");
    if (!spacings.empty() && !std::isnan(spacings[axis])) return spacings[axis];
    auto const lowest = axis_numbers("axis mins"), highest = axis_numbers("axis maxs");
    if (lowest.empty() || highest.empty()) return std::nullopt;
    bool const node = !centers_.empty() && centers_[axis] == "node";
    double const intervals = static_cast<double>(sizes_[axis]) - (node ? 1 : 0);
    double const spacing = (highest[axis] - lowest[axis]) / intervals;
    return std::isfinite(spacing) && spacing != 0 ? std::optional(spacing) : std::nullopt;
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
    std::array<bool, 3> known{};
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
        std::size_t const axis = chosen_[i];
        int const a = static_cast<int>(i);
        bool const has_direction = !directions_.empty() && directions_[axis];
        known[i] = has_direction || directions_.empty(); // what has none among others becomes perpendicular to them
        Vec3 along;
        if (has_direction) {
            along = space_vector(*directions_[axis]);
            if (directions_[axis]->size() == 4 && directions_[axis]->back() != 0)
                fail(text("axis ", static_cast<std::int64_t>(axis), " leans into the fourth dimension of the space"));
        } else {
            along[a] = spacing_of(axis).value_or(1);
            if (directions_.empty() && !header_.has("space origin")) geometry.origin[a] = first_sample(axis, along[a]);
        }
        set_axis(geometry, a, along, text("'", header_.name, "': the ", has_direction ? "space direction" : "spacing"));
    }
    complete_directions(geometry, known);
    read_origin(volume);
}

/// Where along that axis the volumes lie, if that is said: in a space of four dimensions, or by the axis' spacing.
std::optional<SequenceAxis> Interpreter::along(std::size_t axis) const {
    SequenceAxis result;
    if (!directions_.empty() && directions_[axis]) {
        auto const& v = *directions_[axis];
        if (v.size() != 4) return std::nullopt;
        if (!(space_vector(v) == Vec3{}))
            fail("the space direction of the fourth axis moves the volume, which those of a series share");
        result.step = v[3];
        if (auto const origin = vectors("space origin"); origin.size() == 1 && origin[0] && origin[0]->size() == 4)
            result.origin = (*origin[0])[3];
    } else {
        auto const step = spacing_of(axis);
        if (!step) return std::nullopt;
        result.step = *step;
        result.origin = first_sample(axis, result.step);
    }
    bool const known = std::isfinite(result.step) && result.step != 0 && std::isfinite(result.origin);
    return known ? std::optional(result) : std::nullopt;
}

void Interpreter::read_origin(Header& volume) const {
    if (!header_.has("space origin")) return;
    auto const origin = vectors("space origin");
    if (origin.size() != 1) fail("'space origin' is not one vector");
    if (origin[0]) volume.geometry.origin = space_vector(*origin[0]);
}

void Interpreter::read_axis_attributes(std::map<std::string, std::string>& attributes) const {
    std::optional<std::size_t> const series = series_axis();
    for (auto const& [name, nothing] : kept_axis_fields) {
        std::string const field = name;
        if (!header_.has(field)) continue;
        auto entries = field == "labels" ? axis_quoted(field) : axis_words(field);
        if (entries.size() < sizes_.size()) fail(text("'", field, "' has too few entries"));
        std::vector<std::string> kept;
        bool plain = field == "kinds";
        for (std::size_t const axis : chosen_) {
            bool const placeholder = plain && is_placeholder(axis); // whose place other samples may take
            kept.push_back(placeholder ? nothing : entries[axis]);
            plain = plain && (placeholder || spatial(axis));
        }
        kept.resize(3, nothing);
        if (!plain) attributes[field] = join(kept, " ");
        if (series && field == "labels" && entries[*series] != nothing) attributes[sequence_label] = entries[*series];
    }
    // Kinds of so many samples each ("3-color", "complex") would not hold for a part of the series.
    constexpr std::array kept_kinds{"domain", "space", "time", "vector", "covariant-vector", "normal", "point"};
    if (series && !kinds_.empty() &&
        std::find(kept_kinds.begin(), kept_kinds.end(), kinds_[*series]) != kept_kinds.end())
        attributes[sequence_kind] = kinds_[*series];
}

/// Of the space's axes, or of the file's: without space directions those are the same.
void Interpreter::read_space_units(std::map<std::string, std::string>& attributes) const {
    std::string const nothing = "\"\"";
    auto const of_space = axis_quoted("space units"), of_axes = axis_quoted("units");
    if (!of_axes.empty() && of_axes.size() < sizes_.size()) fail("'units' has too few entries");
    std::vector<std::string> units = of_space;
    if (of_space.empty() && !of_axes.empty())
        for (std::size_t const axis : chosen_) units.push_back(of_axes[axis]);
    std::optional<std::size_t> const series = series_axis();
    std::string along = series && !of_axes.empty() ? of_axes[*series] : nothing;
    if (of_space.size() == 4 && along == nothing) along = of_space[3];
    units.resize(3, nothing);
    if (std::any_of(units.begin(), units.end(), [&](auto const& u) { return u != nothing; }))
        attributes["space units"] = join(units, " ");
    if (series && along != nothing) attributes[sequence_units] = along;
}

/// The columns of the measurement frame, of their first three components.
void Interpreter::read_frame(std::map<std::string, std::string>& attributes) const {
    if (!header_.has("measurement frame")) return;
    auto const columns = vectors("measurement frame");
    attributes["measurement frame"] = header_["measurement frame"];
    if (columns.size() != 4) return;
    std::vector<std::string> kept;
    for (std::size_t i = 0; i < 3; ++i) {
        Vec3 const v = columns[i] ? space_vector(*columns[i]) : Vec3{};
        kept.push_back(columns[i] ? text("(", v.x, ",", v.y, ",", v.z, ")") : "none");
    }
    attributes["measurement frame"] = join(kept, " ");
}

void Interpreter::read_attributes(RawLayout& layout) const {
    Header& volume = layout.header;
    auto& attributes = volume.attributes;
    attributes = header_.pairs;
    if (auto const found = attributes.find("vkt attributes"); found != attributes.end()) {
        auto others = parse_attributes(found->second);
        attributes.erase(found);
        attributes.merge(others);
    }
    if (std::string const space = frame_name(header_["space"]); !space.empty()) attributes["space"] = space;
    for (std::string const field : kept_fields)
        if (header_.has(field)) attributes[field] = header_[field];
    read_axis_attributes(attributes);
    read_space_units(attributes);
    read_frame(attributes);
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
    if (auto const found = attributes.find("vkt error"); found != attributes.end()) {
        volume.error = parse_volume_error(found->second);
        attributes.erase(found);
    }
    volume = in_utf8(std::move(volume));
}

RawLayout Interpreter::layout() {
    RawLayout layout;
    read_axes();
    choose_axes(layout);
    layout.header.dtype = type();
    read_encoding(layout);
    read_files(layout);
    read_geometry(layout.header);
    if (sequence_ && holds_samples(*sequence_)) layout.channels = layout.volumes;
    if (sequence_ && layout.channels == 1) layout.sequence = along(*sequence_);
    if (components_) layout.components.along = along(*components_);
    read_attributes(layout);
    return layout;
}

} // namespace

RawLayout nrrd_layout(NrrdHeader const& header, bool trust_paths) { return Interpreter(header, trust_paths).layout(); }

std::string nrrd_type_name(DataType type) {
    for (auto const& entry : type_names)
        if (entry.type == type) return entry.name;
    return {};
}

std::string nrrd_space(std::string_view name) {
    std::string const frame = frame_name(name);
    bool const known = std::find(nrrd_spaces.begin(), nrrd_spaces.end(), frame) != nrrd_spaces.end();
    return known ? frame : std::string();
}

std::optional<std::vector<std::string>> quoted_entries(std::string_view list) {
    std::vector<std::string> entries;
    while (!(list = trimmed(list)).empty()) {
        if (list.front() != '"') return std::nullopt;
        std::size_t end = 1;
        while (end < list.size() && list[end] != '"') end += list[end] == '\\' ? 2 : 1;
        if (end >= list.size()) return std::nullopt;
        entries.emplace_back(list.substr(0, end + 1));
        list.remove_prefix(end + 1);
    }
    return entries;
}

} // namespace vkt
