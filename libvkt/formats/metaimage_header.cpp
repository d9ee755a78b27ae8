// Fields of MetaImage headers, in today's and older spellings.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/metaimage_header.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace vkt {

namespace {

constexpr std::size_t largest_header = std::size_t{16} << 20;

struct TypeName {
    char const* name;
    DataType type;
};
/// MET_LONG has four bytes in files, whatever the machine. The first name of each type is the one that is written.
constexpr std::array type_names{
    TypeName{"MET_UCHAR", DataType::uint8},       TypeName{"MET_CHAR", DataType::int8},
    TypeName{"MET_USHORT", DataType::uint16},     TypeName{"MET_SHORT", DataType::int16},
    TypeName{"MET_UINT", DataType::uint32},       TypeName{"MET_INT", DataType::int32},
    TypeName{"MET_ULONG_LONG", DataType::uint64}, TypeName{"MET_LONG_LONG", DataType::int64},
    TypeName{"MET_FLOAT", DataType::float32},     TypeName{"MET_DOUBLE", DataType::float64},
    TypeName{"MET_ASCII_CHAR", DataType::int8},   TypeName{"MET_ULONG", DataType::uint32},
    TypeName{"MET_LONG", DataType::int32},
};

/// Fields that decide something here, then those that MetaIO defines and that say nothing about a volume.
constexpr std::array known_fields{
    "ObjectType",
    "ObjectSubType",
    "NDims",
    "DimSize",
    "ElementType",
    "ElementDataFile",
    "ElementSpacing",
    "ElementSize",
    "ElementNumberOfChannels",
    "BinaryData",
    "BinaryDataByteOrderMSB",
    "ElementByteOrderMSB",
    "CompressedData",
    "CompressedDataSize",
    "HeaderSize",
    "TransformMatrix",
    "Rotation",
    "Orientation",
    "Offset",
    "Position",
    "Origin",
    "AnatomicalOrientation",
    "DistanceUnits",
    "ElementToIntensityFunctionSlope",
    "ElementToIntensityFunctionOffset",
    "CenterOfRotation",
    "CompressionLevel",
    "HeaderSizePerSlice",
    "ElementMin",
    "ElementMax",
    "Color",
    "ID",
    "ParentID",
    "ElementOrigin",
    "ElementDirection",
    "SequenceID",
    unknown_sequence,
};

class Interpreter {
public:
    Interpreter(MetaImageHeader const& header, bool trust_paths) : header_(header), trust_paths_(trust_paths) {}
    RawLayout layout();

private:
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", header_.name, "': ", what), hint);
    }
    /// The first of these fields that is there, or null.
    std::string const* find(std::initializer_list<char const*> names) const;
    std::string const& needed(char const* name) const;
    std::int64_t integer(std::string const& word, char const* field) const;
    std::vector<double> numbers(std::initializer_list<char const*> names, std::size_t count) const;
    bool flag(std::initializer_list<char const*> names) const;

    void read_dims(RawLayout& layout);
    DataType type() const;
    void read_encoding(RawLayout& layout) const;
    void read_files(RawLayout& layout) const;
    void read_geometry(RawLayout& layout) const;
    void read_attributes(Header& volume) const;

    MetaImageHeader const& header_;
    bool trust_paths_;
    std::size_t dimension_ = 0;
    std::vector<std::int64_t> sizes_;
};

std::string const* Interpreter::find(std::initializer_list<char const*> names) const {
    for (char const* const name : names)
        if (auto const found = header_.fields.find(name); found != header_.fields.end()) return &found->second;
    return nullptr;
}

std::string const& Interpreter::needed(char const* name) const {
    std::string const* const value = find({name});
    if (!value) fail(text("MetaImage field ", name, " is missing"));
    return *value;
}

std::int64_t Interpreter::integer(std::string const& word, char const* field) const {
    auto const value = integer_in(word);
    if (!value) fail(text(field, " = '", word.substr(0, 40), "' is no integer"));
    return *value;
}

/// Exactly `count` numbers of one of the fields; empty if none of them is there.
std::vector<double> Interpreter::numbers(std::initializer_list<char const*> names, std::size_t count) const {
    std::string const* const line = find(names);
    if (!line) return {};
    std::vector<double> values;
    for (auto const& word : words_of(*line)) {
        auto const value = number_in(word);
        if (!value || !std::isfinite(*value))
            fail(text(*names.begin(), " has '", word.substr(0, 40), "', which is no number"));
        values.push_back(*value);
    }
    if (values.size() < count)
        fail(text(*names.begin(), " has ", std::ssize(values), " numbers, not ", static_cast<std::int64_t>(count)));
    return values;
}

bool Interpreter::flag(std::initializer_list<char const*> names) const {
    std::string const* const value = find(names);
    if (!value || value->empty()) return false;
    return value->front() == 'T' || value->front() == 't' || value->front() == '1' || value->front() == 'Y' ||
           value->front() == 'y';
}

void Interpreter::read_dims(RawLayout& layout) {
    if (std::string const* const kind = find({"ObjectType"}); kind && lower_case(*kind) != "image")
        fail(text("ObjectType '", kind->substr(0, 40), "' is not Image"));
    std::int64_t const dimension = integer(needed("NDims"), "NDims");
    if (dimension < 1 || dimension > 4) fail(text("NDims = ", dimension, " is not between 1 and 4"));
    dimension_ = static_cast<std::size_t>(dimension);
    for (auto const& word : words_of(needed("DimSize"))) sizes_.push_back(integer(word, "DimSize"));
    if (sizes_.size() != dimension_) fail(text("DimSize has ", std::ssize(sizes_), " numbers, not ", dimension));
    for (std::int64_t const size : sizes_)
        if (size < 1 || size > max_extent) fail(text("DimSize ", size, " is not between 1 and 2^40"));
    for (std::size_t i = 0; i < std::min<std::size_t>(dimension_, 3); ++i)
        layout.header.dims[static_cast<int>(i)] = sizes_[i];
    if (dimension_ == 4) layout.volumes = sizes_[3];
    if (std::string const* const channels = find({"ElementNumberOfChannels"}))
        layout.components.count = integer(*channels, "ElementNumberOfChannels");
    if (layout.components.count < 1) fail(text("ElementNumberOfChannels = ", layout.components.count));
}

DataType Interpreter::type() const {
    std::string word = needed("ElementType");
    if (word.ends_with("_ARRAY")) word.resize(word.size() - 6);
    for (auto const& entry : type_names)
        if (word == entry.name) return entry.type;
    fail(text("ElementType '", word.substr(0, 40), "' is not supported"));
}

void Interpreter::read_encoding(RawLayout& layout) const {
    layout.big_endian = flag({"BinaryDataByteOrderMSB", "ElementByteOrderMSB"});
    if (flag({"CompressedData"}))
        layout.encoding = Encoding::deflate;
    else if (find({"BinaryData"}) && !flag({"BinaryData"}))
        layout.encoding = Encoding::text;
    if (std::string const* const size = find({"HeaderSize"})) {
        layout.byte_skip = integer(*size, "HeaderSize");
        if (layout.byte_skip < -1) fail("HeaderSize is negative");
    }
}

/// "LOCAL", "LIST [2D]", "pattern first last [step]" or a name.
void Interpreter::read_files(RawLayout& layout) const {
    std::string const& field = needed("ElementDataFile");
    auto const words = words_of(field);
    if (words.empty()) fail("ElementDataFile names no file");
    if (lower_case(words[0]) == "local") return;
    if (lower_case(words[0]) == "list") {
        layout.files = header_.listed_files;
        std::int64_t axes = static_cast<std::int64_t>(dimension_) - 1;
        if (words.size() > 1) {
            std::string axis = words[1];
            if (axis.ends_with("D") || axis.ends_with("d")) axis.pop_back();
            axes = integer(axis, "ElementDataFile = LIST");
        }
        if (axes < 1 || axes > static_cast<std::int64_t>(dimension_)) axes = static_cast<std::int64_t>(dimension_);
        std::int64_t pieces = 1;
        for (std::size_t i = static_cast<std::size_t>(axes); i < dimension_; ++i)
            if (__builtin_mul_overflow(pieces, sizes_[i], &pieces)) fail("DimSize overflows");
        if (pieces != std::ssize(layout.files))
            fail(text(pieces, " data files needed, ", std::ssize(layout.files), " named"));
    } else if (words.size() >= 3 && words.size() <= 4 && is_numbered(words[0])) {
        layout.files =
            numbered_files(words[0], integer(words[1], "ElementDataFile"), integer(words[2], "ElementDataFile"),
                           words.size() > 3 ? integer(words[3], "ElementDataFile") : 1);
    } else {
        layout.files = {field};
    }
    for (auto& file : layout.files) file = beside(header_.name, file, trust_paths_);
}

void Interpreter::read_geometry(RawLayout& layout) const {
    Geometry& geometry = layout.header.geometry;
    // Old files have only ElementSize, the size of a voxel; with ElementSpacing it is something else.
    auto const spacing = numbers({"ElementSpacing", "ElementSize"}, dimension_);
    auto const matrix = numbers({"TransformMatrix", "Rotation", "Orientation"}, dimension_ * dimension_);
    auto const offset = numbers({"Offset", "Position", "Origin"}, dimension_);
    // Row i is the direction of axis i. What it lacks to unit length, and the sign of the spacing, count as well.
    auto const row = [&](std::size_t i, std::size_t j) {
        return (spacing.empty() ? 1 : spacing[i]) * (matrix.empty() ? i == j : matrix[i * dimension_ + j]);
    };
    std::size_t const axes = std::min<std::size_t>(dimension_, 3);
    std::array<bool, 3> known{};
    for (std::size_t i = 0; i < axes; ++i) {
        int const axis = static_cast<int>(i);
        Vec3 along;
        for (std::size_t j = 0; j < axes; ++j) along[static_cast<int>(j)] = row(i, j);
        set_axis(geometry, axis, along, text("'", header_.name, "': the direction or spacing"));
        if (!offset.empty()) geometry.origin[axis] = offset[i];
        known[i] = true;
    }
    complete_directions(geometry, known);
    if (dimension_ < 4) return;
    for (std::size_t i = 0; i < 3; ++i)
        if (row(i, 3) != 0 || row(3, i) != 0) fail("the fourth axis is not perpendicular to the others");
    if (find({unknown_sequence})) return;
    layout.sequence = SequenceAxis{offset.empty() ? 0 : offset[3], row(3, 3)};
    if (layout.sequence->step == 0) fail("the step of the fourth axis is zero");
}

void Interpreter::read_attributes(Header& volume) const {
    auto& attributes = volume.attributes;
    for (auto const& [key, value] : header_.fields)
        if (!is_metaimage_field(key)) attributes[key] = value;
    // Our own writer fills room with dots.
    if (auto const comment = attributes.find("Comment");
        comment != attributes.end() && comment->second.find_first_not_of('.') == std::string::npos)
        attributes.erase(comment);
    auto const take = [&](char const* key) {
        std::string value;
        if (auto const found = attributes.find(key); found != attributes.end()) {
            value = found->second;
            attributes.erase(found);
        }
        return value;
    };
    // ITK and MetaIO mean left-posterior-superior coordinates; a file that says how its axes lie there means it, too,
    // and ITK has no words for four axes.
    if (auto const* orientation = find({"AnatomicalOrientation"});
        orientation && (orientation->find('?') == std::string::npos || *orientation == "????"))
        attributes["space"] = "left-posterior-superior";
    if (std::string const space = take("VktSpace"); !space.empty()) attributes["space"] = space;
    if (auto const* unit = find({"DistanceUnits"}); unit && *unit != "?")
        attributes["space units"] = text("\"", *unit, "\" \"", *unit, "\" \"", *unit, "\"");
    if (auto const slope = numbers({"ElementToIntensityFunctionSlope"}, 1); !slope.empty())
        volume.values.slope = slope[0];
    if (auto const offset = numbers({"ElementToIntensityFunctionOffset"}, 1); !offset.empty())
        volume.values.intercept = offset[0];
    volume.units = take("VktUnits");
    if (std::string const others = take("VktAttributes"); !others.empty()) {
        auto kept = parse_attributes(others);
        attributes.merge(kept);
    }
    if (std::string const history = take("VktHistory"); !history.empty()) volume.history = parse_history(history);
    if (std::string const error = take("VktError"); !error.empty()) volume.error = parse_volume_error(error);
    volume = in_utf8(std::move(volume));
}

RawLayout Interpreter::layout() {
    RawLayout layout;
    read_dims(layout);
    layout.header.dtype = type();
    read_encoding(layout);
    read_files(layout);
    read_geometry(layout);
    read_attributes(layout.header);
    return layout;
}

} // namespace

MetaImageHeader read_metaimage_header(ByteSource& bytes) {
    MetaImageHeader header;
    header.name = bytes.name();
    std::size_t size = 0;
    while (auto const line = bytes.read_line()) {
        size += line->size() + 1;
        if (size > largest_header) throw Error(ErrorKind::data, text("'", header.name, "': the header exceeds 16 MiB"));
        std::string_view const content = trimmed(*line);
        if (content.empty() || content.front() == '#') continue;
        std::size_t equals = content.find('=');
        if (equals == std::string_view::npos) equals = content.find(':');
        if (equals == std::string_view::npos)
            throw Error(ErrorKind::data,
                        text("'", header.name, "': '", content.substr(0, 60), "' is no MetaImage header line"));
        std::string const key(trimmed(content.substr(0, equals)));
        std::string const value(trimmed(content.substr(equals + 1)));
        if (!header.fields.emplace(key, value).second)
            throw Error(ErrorKind::data, text("'", header.name, "': field ", key.substr(0, 60), " stands twice"));
        if (key != "ElementDataFile") continue;
        if (lower_case(value).starts_with("list"))
            while (auto const file = bytes.read_line()) {
                size += file->size() + 1;
                if (size > largest_header)
                    throw Error(ErrorKind::data, text("'", header.name, "': the header exceeds 16 MiB"));
                if (!trimmed(*file).empty()) header.listed_files.emplace_back(trimmed(*file));
            }
        return header;
    }
    throw Error(ErrorKind::data, text("'", header.name, "' ended early: MetaImage field ElementDataFile is missing"));
}

RawLayout metaimage_layout(MetaImageHeader const& header, bool trust_paths) {
    return Interpreter(header, trust_paths).layout();
}

std::string metaimage_type_name(DataType type) {
    for (auto const& entry : type_names)
        if (entry.type == type) return entry.name;
    return {};
}

bool is_metaimage_field(std::string const& key) {
    return std::find(known_fields.begin(), known_fields.end(), key) != known_fields.end();
}

} // namespace vkt
