// VTK's legacy files (.vtk) of structured points: lines of text, and numbers as text or big-endian bytes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/vtk_legacy.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/core/volume.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/tree_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>

namespace vkt {
namespace {

struct TypeName {
    char const* name;
    DataType type;
};
constexpr TypeName type_names[] = {
    {"unsigned_char", DataType::uint8}, {"char", DataType::int8},
    {"signed_char", DataType::int8},    {"unsigned_short", DataType::uint16},
    {"short", DataType::int16},         {"unsigned_int", DataType::uint32},
    {"int", DataType::int32},           {"unsigned_long", DataType::uint64},
    {"long", DataType::int64},          {"float", DataType::float32},
    {"double", DataType::float64},      {"vtkidtype", DataType::int32}, // as VTK writes it
    {"vtktypeint64", DataType::int64},  {"vtktypeuint64", DataType::uint64}};

std::string decoded(std::string const& name) {
    std::string result;
    for (std::size_t i = 0; i < name.size(); ++i) {
        int code = 0;
        auto const* const from = name.data() + i + 1;
        if (name[i] == '%' && i + 2 < name.size() && std::from_chars(from, from + 2, code, 16).ptr == from + 2) {
            result += static_cast<char>(code);
            i += 2;
        } else {
            result += name[i];
        }
    }
    return result;
}

struct LegacyArray {
    std::string name;
    DataType type = DataType::uint8;
    std::int64_t components = 1;
    bool cells = false;
    std::int64_t position = 0;
    bool shares = false; ///< bytes as text, written as parts of 255
};

class Reader {
public:
    explicit Reader(ByteSource& bytes) : bytes_(bytes) {}

    void read() {
        std::string const first = line();
        if (!first.starts_with(vtk_legacy_magic)) fail("does not begin as a VTK file does");
        line();                         // a title
        auto const kind = next_words(); // old files have blank lines before it
        std::string const form = kind ? lower_case(kind->front()) : "";
        if (form != "ascii" && form != "binary") fail("is neither ASCII nor BINARY");
        ascii_ = form == "ascii";
        while (auto const words = next_words()) statement(*words);
        if (arrays.empty())
            fail(text("holds no array of numbers",
                      not_read.empty() ? "" : text(", but ", not_read.front(), ", which is not read")));
        geometry.origin = index_to_world(geometry, lower_);
    }

    Index3 dims{0, 0, 0};
    Geometry geometry;
    std::vector<LegacyArray> arrays;
    std::vector<std::string> not_read;
    bool ascii() const { return ascii_; }

    Index3 extent(bool cells) const {
        Index3 d = dims;
        for (int a = 0; cells && a < 3; ++a)
            if (d[a] > 1) --d[a];
        return d;
    }

    /// Where the next `n` words end.
    std::int64_t skip_words(std::int64_t n) {
        bool inside = false;
        while (true) {
            auto const ahead = bytes_.peek(std::size_t{16} << 10);
            if (ahead.empty()) {
                if (n > (inside ? 1 : 0)) fail("ended early: an array is incomplete");
                return bytes_.position();
            }
            for (std::size_t i = 0; i < ahead.size(); ++i) {
                char const c = static_cast<char>(ahead[i]);
                bool const blank = c == ' ' || (c >= '\t' && c <= '\r');
                if (blank && inside && --n == 0) {
                    bytes_.skip(static_cast<std::int64_t>(i));
                    return bytes_.position();
                }
                inside = !blank;
            }
            bytes_.skip(std::ssize(ahead));
        }
    }

private:
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", bytes_.name(), "': ", what), hint);
    }
    std::string line() {
        auto result = bytes_.read_line();
        if (!result) fail("ended early: its header is incomplete");
        return *result;
    }
    std::optional<std::vector<std::string>> next_words() {
        while (auto const read = bytes_.read_line()) {
            auto words = words_of(*read);
            if (!words.empty()) return words;
        }
        return std::nullopt;
    }

    std::vector<double> numbers(std::vector<std::string> const& words) const {
        std::vector<double> values;
        for (std::size_t i = 1; i < words.size(); ++i) {
            auto const value = number_in(words[i]);
            if (!value || !std::isfinite(*value))
                fail(text(words[0], " has '", printable(words[i].substr(0, 40)), "', which is no number"));
            values.push_back(*value);
        }
        if (values.size() != 3) fail(text(words[0], " needs three numbers"));
        return values;
    }

    std::int64_t integer(std::string const& word) const {
        auto const value = integer_in(word);
        if (!value || *value < 0 || *value > max_extent)
            fail(text("'", printable(word.substr(0, 40)), "' is no count"));
        return *value;
    }

    void statement(std::vector<std::string> const& words) {
        std::string const key = lower_case(words[0]);
        if (key == "dataset") {
            if (words.size() < 2 || lower_case(words[1]) != "structured_points")
                fail(text("holds ", words.size() < 2 ? "nothing" : printable(words[1].substr(0, 40)),
                          ", not STRUCTURED_POINTS, which volumes are"),
                     "in ParaView: Resample To Image, saved as .vti");
        } else if (key == "dimensions") {
            std::vector<double> const v = numbers(words);
            for (int a = 0; a < 3; ++a) {
                double const d = v[static_cast<std::size_t>(a)];
                if (d < 1 || d > static_cast<double>(max_extent) || d != std::floor(d))
                    fail("DIMENSIONS are no extents");
                dims[a] = static_cast<std::int64_t>(d);
            }
            Header sound;
            sound.dims = dims;
            sound.dtype = DataType::float64;
            try {
                check(sound);
            } catch (Error const& error) {
                fail(error.what());
            }
        } else if (key == "extent") { // points that do not begin with index 0
            if (words.size() != 7) fail("EXTENT needs six numbers");
            std::vector<std::string> counts{"DIMENSIONS"};
            for (std::size_t a = 0; a < 3; ++a) {
                auto const first = integer_in(words[2 * a + 1]), last = integer_in(words[2 * a + 2]);
                if (!first || !last || std::abs(*first) > max_extent || std::abs(*last) > max_extent)
                    fail("EXTENT is no extent");
                counts.push_back(text(*last - *first + 1));
                lower_[static_cast<int>(a)] = static_cast<double>(*first);
            }
            statement(counts);
        } else if (key == "spacing" || key == "aspect_ratio") {
            std::vector<double> const v = numbers(words);
            for (int a = 0; a < 3; ++a) {
                double const s = v[static_cast<std::size_t>(a)];
                Vec3 axis;
                axis[a] = s == 0 ? 1 : s;
                set_axis(geometry, a, axis, "spacing");
            }
        } else if (key == "origin") {
            std::vector<double> const v = numbers(words);
            geometry.origin = {v[0], v[1], v[2]};
        } else if (key == "point_data" || key == "cell_data") {
            if (words.size() != 2) fail(text(words[0], " needs a count"));
            if (dims.x == 0) fail("has data before DIMENSIONS");
            cells_ = key == "cell_data";
            Index3 const d = extent(cells_);
            count_ = integer(words[1]);
            if (count_ != d.x * d.y * d.z) fail(text(words[0], " ", count_, " does not fit its DIMENSIONS"));
        } else if (key == "scalars") {
            if (words.size() < 3) fail("SCALARS needs a name and a type");
            std::int64_t const components = words.size() > 3 ? integer(words[3]) : 1;
            // A table follows in its own line, which old files leave out, or put behind a blank one.
            auto const ahead = bytes_.peek(64);
            std::string_view const next(reinterpret_cast<char const*>(ahead.data()), ahead.size());
            std::size_t const begin = std::min(next.find_first_not_of(" \t\r\n"), next.size());
            if (lower_case(next.substr(begin, 12)) == "lookup_table") {
                bytes_.skip(static_cast<std::int64_t>(begin));
                line();
            }
            array(words[1], words[2], components);
        } else if (key == "global_ids" || key == "pedigree_ids" || key == "edge_flags") {
            if (words.size() < 3) fail(text(words[0], " needs a name and a type"));
            array(words[1], words[2], 1);
        } else if (key == "vectors" || key == "normals") {
            if (words.size() < 3) fail(text(words[0], " needs a name and a type"));
            array(words[1], words[2], 3);
        } else if (key == "tensors" || key == "tensors6") {
            if (words.size() < 3) fail("TENSORS needs a name and a type");
            array(words[1], words[2], key == "tensors" ? 9 : 6);
        } else if (key == "texture_coordinates") {
            if (words.size() < 4) fail("TEXTURE_COORDINATES needs a name, dimensions and a type");
            array(words[1], words[3], integer(words[2]));
        } else if (key == "color_scalars") {
            if (words.size() < 3) fail("COLOR_SCALARS needs a name and a count");
            std::size_t const before = arrays.size();
            array(words[1], "unsigned_char", integer(words[2]));
            if (arrays.size() > before) arrays.back().shares = ascii_;
        } else if (key == "lookup_table") {
            if (words.size() < 3) return;
            skip(product(4, integer(words[2])), "unsigned_char", words[1]);
        } else if (key == "field") {
            if (words.size() < 3) fail("FIELD needs a name and a count");
            fields_ = integer(words[2]);
        } else if (key == "metadata") {
            while (auto const read = bytes_.read_line()) {
                if (trimmed(*read).empty()) break;
                // A line for each, which is empty where a component has no name.
                if (lower_case(trimmed(*read)) == "component_names")
                    for (std::int64_t i = 0; i < components_ && bytes_.read_line(); ++i) {
                    }
            }
        } else if (fields_ > 0 && words.size() == 4) {
            --fields_;
            std::int64_t const components = integer(words[1]), tuples = integer(words[2]);
            components_ = components;
            if (count_ > 0 && tuples == count_)
                array(words[0], words[3], components);
            else
                skip(product(components, tuples), words[3], words[0]);
        } else {
            fail(text("'", printable(words[0].substr(0, 40)), "' is no keyword of structured points"));
        }
    }

    std::optional<DataType> type_named(std::string const& word) const {
        for (auto const& entry : type_names)
            if (lower_case(word) == entry.name) return entry.type;
        return std::nullopt;
    }

    std::int64_t product(std::int64_t a, std::int64_t b) const {
        std::int64_t result = 0;
        if (__builtin_mul_overflow(a, b, &result)) fail("claims more values than any file can have");
        return result;
    }

    static bool is_text(std::string const& type) {
        std::string const name = lower_case(type);
        return name == "string" || name == "utf8_string" || name == "unicode_string";
    }

    /// The values of an array, whatever it is.
    void skip(std::int64_t values, std::string const& type_word, std::string const& name) {
        if (values == 0) return;
        if (is_text(type_word)) return skip_texts(values);
        bool const bits = lower_case(type_word) == "bit";
        auto const type = type_named(type_word);
        if (!bits && !type)
            fail(text("array '", printable(name), "' has the type ", printable(type_word.substr(0, 40)),
                      ", which volumes do not have"));
        if (ascii_) {
            skip_words(values);
            return;
        }
        std::int64_t const bytes = bits ? (values + 7) / 8 : product(values, static_cast<std::int64_t>(size_of(*type)));
        if (bytes > bytes_.size() - bytes_.position())
            fail(text("ended early: an array of ", bytes, " bytes, ", bytes_.size() - bytes_.position(), " found"));
        bytes_.seek(bytes_.position() + bytes);
    }

    /// Texts are lines, or follow their lengths, whose first two bits say in how many bytes they stand.
    void skip_texts(std::int64_t n) {
        for (std::int64_t i = 0; i < n; ++i) {
            if (ascii_) {
                line();
                continue;
            }
            auto const ahead = bytes_.peek(8);
            std::size_t const width =
                ahead.empty() ? 1 : std::size_t{8} >> (std::to_integer<unsigned>(ahead.front()) >> 6U);
            if (ahead.size() < width) fail("ended early: a text is incomplete");
            std::uint64_t length = 0;
            for (std::size_t k = 0; k < width; ++k) length = length << 8 | std::to_integer<std::uint64_t>(ahead[k]);
            length &= ~std::uint64_t{0} >> (64 - 8 * width + 2);
            std::int64_t const at = bytes_.position() + static_cast<std::int64_t>(width);
            if (length > static_cast<std::uint64_t>(bytes_.size() - at)) fail("ended early: a text is incomplete");
            bytes_.seek(at + static_cast<std::int64_t>(length));
        }
    }

    void array(std::string const& name, std::string const& type_word, std::int64_t components) {
        if (count_ == 0) fail("has an array before POINT_DATA or CELL_DATA");
        if (components < 1 || components > 65536)
            fail(text("array '", printable(name), "' has no number of components"));
        auto const type = type_named(type_word);
        LegacyArray one{decoded(name), type.value_or(DataType::uint8), components, cells_, bytes_.position()};
        skip(product(count_, components), type_word, name);
        components_ = components;
        if (type)
            arrays.push_back(std::move(one));
        else
            not_read.push_back(text("array '", decoded(name), "' of type ", lower_case(type_word)));
    }

    ByteSource& bytes_;
    bool ascii_ = false, cells_ = false;
    std::int64_t count_ = 0, fields_ = 0;
    std::int64_t components_ = 1; ///< of the array before
    Vec3 lower_;                  ///< index of the first point
};

/// The chosen array, with what the file holds besides.
class LegacySource : public Source {
public:
    /// `numbers` are those of the array, of the type in which they are stored.
    LegacySource(Header header, std::unique_ptr<Source> numbers, bool shares, std::vector<AmrVariable> choices,
                 std::vector<std::string> not_read, std::string name)
        : header_(std::move(header)), numbers_(std::move(numbers)), shares_(shares), choices_(std::move(choices)),
          not_read_(std::move(not_read)), name_(std::move(name)) {}

    bool next_volume() override {
        if (!numbers_->next_volume()) return false;
        auto const& said = numbers_->header().attributes;
        if (auto const channel = said.find("channel"); channel != said.end())
            header_.attributes["channel"] = channel->second;
        return true;
    }
    Header const& header() const override { return header_; }
    Access access() const override { return numbers_->access(); }
    std::vector<std::string> not_read() const override { return not_read_; }
    void finish() override { numbers_->finish(); }

    void read(AnyView out) override {
        if (!choices_.empty()) choose_variable(choices_, "", name_);
        if (!shares_) return numbers_->read(out);
        // Some rows at a time.
        Header part = numbers_->header();
        std::int64_t const width = out.dims().x;
        std::int64_t const rows = std::max<std::int64_t>((std::int64_t{1} << 18) / std::max<std::int64_t>(width, 1), 1);
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; y += rows) {
                part.dims = {width, std::min(rows, out.box.upper.y - y), 1};
                Volume values(part);
                AnyView const all = values.mutable_view().moved_to({out.box.lower.x, y, z});
                numbers_->read(all);
                for (std::int64_t r = y; r < all.box.upper.y; ++r)
                    for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; ++x)
                        put_share(all.at(x, r, z), out.at(x, r, z));
            }
    }

private:
    static void put_share(std::byte const* from, std::byte* to) {
        float share = 0;
        std::memcpy(&share, from, sizeof share);
        *to = static_cast<std::byte>(std::lround(255 * (share > 0 ? std::min(share, 1.0F) : 0.0F)));
    }

    Header header_;
    std::unique_ptr<Source> numbers_;
    bool shares_; ///< of 255, as float32
    std::vector<AmrVariable> choices_;
    std::vector<std::string> not_read_;
    std::string name_;
};

/// Without a name, the only array, or the only one of one component.
std::optional<std::size_t> only_scalars(std::vector<LegacyArray> const& arrays) {
    if (arrays.size() == 1) return 0;
    auto const scalar = [](LegacyArray const& a) { return a.components == 1; };
    if (std::count_if(arrays.begin(), arrays.end(), scalar) != 1) return std::nullopt;
    return static_cast<std::size_t>(std::find_if(arrays.begin(), arrays.end(), scalar) - arrays.begin());
}

std::unique_ptr<Source> open_legacy(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    bytes = seekable_bytes(std::move(bytes));
    std::string const name = bytes->name();
    Reader reader(*bytes);
    reader.read();
    std::vector<AmrVariable> all;
    for (LegacyArray const& array : reader.arrays) {
        all.emplace_back();
        all.back().name = array.name;
        all.back().dtype = array.type;
    }
    auto const only = options.variable.empty() ? only_scalars(reader.arrays) : std::nullopt;
    bool const open = options.variable.empty() && !only;
    LegacyArray const chosen = reader.arrays[open ? 0 : only ? *only : choose_variable(all, options.variable, name)];
    Header header;
    header.dims = reader.extent(chosen.cells);
    header.dtype = chosen.type;
    header.geometry = reader.geometry;
    Vec3 first;
    for (int a = 0; a < 3; ++a)
        if (chosen.cells && reader.dims[a] > 1) first[a] = 0.5;
    header.geometry.origin = index_to_world(reader.geometry, first);
    header.attributes["variable"] = chosen.name;
    if (all.size() > 1) {
        std::vector<std::string> names;
        for (LegacyArray const& array : reader.arrays) {
            names.push_back(array.name);
            header.attributes["variable " + array.name] =
                text(array.type, array.components > 1 ? text(" x ", array.components) : "",
                     array.cells ? ", cells" : ", points");
        }
        header.attributes["variables"] = join(names, " ");
    }
    header = in_utf8(std::move(header));
    RawLayout layout;
    layout.header.dims = header.dims;
    layout.header.dtype = chosen.shares ? DataType::float32 : chosen.type;
    layout.big_endian = true;
    layout.components.count = chosen.components;
    std::int64_t values = 0;
    if (__builtin_mul_overflow(layout.header.voxels(), chosen.components, &values))
        throw Error(ErrorKind::data, text("'", name, "': more values than can be"));
    bytes->seek(chosen.position);
    if (reader.ascii()) {
        // No further than its last number, behind which words follow.
        std::int64_t const end = reader.skip_words(values);
        layout.encoding = Encoding::text;
        std::shared_ptr<ByteSource> const file = std::move(bytes);
        bytes =
            std::make_unique<ByteSource>(name, [file, end, at = chosen.position](std::byte* to, std::size_t n) mutable {
                auto const count = std::min<std::int64_t>(end - at, static_cast<std::int64_t>(n));
                file->read_at(at, to, static_cast<std::size_t>(count));
                at += count;
                return static_cast<std::size_t>(count);
            });
    }
    return std::make_unique<LegacySource>(std::move(header), raw_source(std::move(bytes), std::move(layout)),
                                          chosen.shares, open ? all : std::vector<AmrVariable>(), reader.not_read,
                                          name);
}

} // namespace

Format vtk_format() {
    return {"vtk",
            "VTK legacy files of structured points",
            {".vtk"},
            [](std::span<std::byte const> head) {
                return head.size() >= vtk_legacy_magic.size() &&
                       std::memcmp(head.data(), vtk_legacy_magic.data(), vtk_legacy_magic.size()) == 0;
            },
            open_legacy,
            create_vtk_legacy};
}

} // namespace vkt
