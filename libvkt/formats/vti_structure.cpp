// The structure of .vti files by expat.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/vti_structure.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <map>

#ifdef VKT_HAVE_EXPAT
#include <expat.h>
#endif

namespace vkt {
namespace {

[[maybe_unused]] constexpr std::size_t most_arrays = 4096, most_pieces = std::size_t{1} << 20;

[[noreturn]] void damaged(std::string const& name, std::string const& what, std::string const& hint = {}) {
    throw Error(ErrorKind::data, text("'", name, "': ", what), hint);
}

#ifdef VKT_HAVE_EXPAT

struct TypeName {
    char const* name;
    DataType type;
};
constexpr TypeName type_names[] = {{"Int8", DataType::int8},       {"UInt8", DataType::uint8},
                                   {"Int16", DataType::int16},     {"UInt16", DataType::uint16},
                                   {"Int32", DataType::int32},     {"UInt32", DataType::uint32},
                                   {"Int64", DataType::int64},     {"UInt64", DataType::uint64},
                                   {"Float32", DataType::float32}, {"Float64", DataType::float64}};

std::optional<DataType> type_named(std::string const& name) {
    for (auto const& entry : type_names)
        if (name == entry.name) return entry.type;
    return std::nullopt;
}

/// Walks through the XML; data stay where they are.
class StructureReader {
public:
    explicit StructureReader(ByteSource& bytes) : bytes_(bytes) { result_.name = bytes.name(); }

    VtiStructure read() {
        parser_ = XML_ParserCreate(nullptr);
        if (parser_ == nullptr) throw std::bad_alloc();
        struct Free {
            XML_Parser parser;
            ~Free() { XML_ParserFree(parser); }
        } const free{parser_};
        XML_SetUserData(parser_, this);
        XML_SetElementHandler(
            parser_,
            [](void* self, XML_Char const* name, XML_Char const** attributes) {
                static_cast<StructureReader*>(self)->guarded(&StructureReader::begin, name, attributes);
            },
            [](void* self, XML_Char const* name) {
                static_cast<StructureReader*>(self)->guarded(&StructureReader::end, name, nullptr);
            });
        XML_SetCharacterDataHandler(parser_, [](void* self, XML_Char const* s, int n) {
            auto* const reader = static_cast<StructureReader*>(self);
            if (reader->keeps_text_ && reader->text_.size() < text_limit)
                reader->text_.append(s, static_cast<std::size_t>(n));
            if (reader->inline_ && !reader->numbers_ && reader->depth_ == reader->array_depth_)
                reader->numbers_ = std::any_of(s, s + n, [](char c) { return c != ' ' && (c < '\t' || c > '\r'); });
        });
        // Nothing that a document may define is needed.
        XML_SetStartDoctypeDeclHandler(parser_, [](void* self, XML_Char const*, XML_Char const*, XML_Char const*, int) {
            auto* const reader = static_cast<StructureReader*>(self);
            reader->guarded(&StructureReader::refuse_definitions, nullptr, nullptr);
        });
        constexpr std::size_t block = std::size_t{256} << 10;
        std::int64_t position = 0;
        while (!stopped_) {
            void* const buffer = XML_GetBuffer(parser_, block);
            if (buffer == nullptr) throw std::bad_alloc();
            auto const n = static_cast<std::size_t>(std::min<std::int64_t>(block, bytes_.size() - position));
            bytes_.read_at(position, buffer, n);
            position += static_cast<std::int64_t>(n);
            auto const status = XML_ParseBuffer(parser_, static_cast<int>(n), n == 0 || position == bytes_.size());
            if (failure_) std::rethrow_exception(failure_);
            if (stopped_) break;
            if (status != XML_STATUS_OK) {
                XML_Error const code = XML_GetErrorCode(parser_);
                bool const early =
                    position == bytes_.size() && (code == XML_ERROR_NO_ELEMENTS || code == XML_ERROR_UNCLOSED_TOKEN ||
                                                  code == XML_ERROR_PARTIAL_CHAR);
                damaged(result_.name, text(early ? "ended early" : "damaged", " at line ",
                                           static_cast<std::int64_t>(XML_GetCurrentLineNumber(parser_)), ": ",
                                           XML_ErrorString(code)));
            }
            if (position == bytes_.size()) break;
        }
        finish();
        return std::move(result_);
    }

private:
    static constexpr std::size_t text_limit = std::size_t{16} << 20;
    using Attributes = std::map<std::string, std::string>;

    /// C code lies between what throws and who catches.
    void guarded(void (StructureReader::*what)(char const*, char const**), char const* name, char const** attributes) {
        if (failure_) return;
        try {
            (this->*what)(name, attributes);
        } catch (...) {
            failure_ = std::current_exception();
            XML_StopParser(parser_, XML_FALSE);
        }
    }

    void refuse_definitions(char const*, char const**) {
        damaged(result_.name, "defines entities of its own, which no VTK file needs");
    }

    std::vector<double> numbers(Attributes& a, char const* key, std::size_t n) const {
        std::vector<double> values;
        for (std::string const& word : words_of(a[key])) {
            auto const value = number_in(word);
            if (!value || !std::isfinite(*value)) break;
            values.push_back(*value);
        }
        if (values.size() != n)
            damaged(result_.name,
                    text(key, "=\"", a[key].substr(0, 80), "\" is not ", static_cast<std::int64_t>(n), " numbers"));
        return values;
    }

    std::array<std::int64_t, 6> extent(Attributes& a, char const* key) const {
        std::vector<double> const v = numbers(a, key, 6);
        std::array<std::int64_t, 6> result{};
        for (std::size_t i = 0; i < 6; ++i) {
            if (std::abs(v[i]) > static_cast<double>(max_extent) || v[i] != std::floor(v[i]))
                damaged(result_.name, text(key, "=\"", a[key].substr(0, 80), "\" is no extent"));
            result[i] = static_cast<std::int64_t>(v[i]);
        }
        return result;
    }

    void begin(char const* element, char const** list) {
        std::string const name = element;
        Attributes a;
        for (; *list != nullptr; list += 2) a.emplace(list[0], list[1]);
        if (++depth_ == 1) return root(name, a);
        if (inline_ && (name == "Piece" || name == "DataArray" || name == "Array" || name == "AppendedData"))
            damaged(result_.name, text("has an element ", name, " within the numbers of an array"));
        // What is known about an array (InformationKey) stands before its numbers or behind them.
        if (inline_ && numbers_ && depth_ == array_depth_ + 1 && !ended_) {
            result_.pieces.back().arrays.back().end = XML_GetCurrentByteIndex(parser_);
            ended_ = true;
        }
        if (name == "ImageData" || name == "PImageData") return image(a);
        if (name == "Piece") return piece(a);
        if (name == "PointData" || name == "PPointData" || name == "CellData" || name == "PCellData") {
            data_ = true;
            cells_ = name == "CellData" || name == "PCellData";
            if (a.count("Scalars") > 0) (cells_ ? result_.active_cells : result_.active_points) = a["Scalars"];
        }
        if (name == "FieldData") fields_ = true;
        if (name == "DataArray" || name == "PDataArray" || name == "Array") array(name, a);
        if (name == "AppendedData") appended(a);
    }

    void end(char const* element, char const**) {
        std::string const name = element;
        --depth_;
        if (inline_ && !numbers_ && depth_ == array_depth_) // numbers begin behind it
            result_.pieces.back().arrays.back().begin =
                XML_GetCurrentByteIndex(parser_) + XML_GetCurrentByteCount(parser_);
        if (name == "PointData" || name == "PPointData" || name == "CellData" || name == "PCellData") data_ = false;
        if (name == "FieldData") fields_ = false;
        if (name != "DataArray" && name != "Array") return;
        if (inline_) {
            VtiArray& one = result_.pieces.back().arrays.back();
            if (!ended_) one.end = std::max<std::int64_t>(XML_GetCurrentByteIndex(parser_), one.begin);
            inline_ = false;
        }
        if (keeps_text_) ours();
    }

    void root(std::string const& name, Attributes& a) {
        if (name != "VTKFile")
            damaged(result_.name,
                    text("is XML, but no VTK file: its first element is ", printable(name.substr(0, 40))));
        std::string const& type = a["type"];
        if (type != "ImageData" && type != "PImageData")
            damaged(result_.name, text("holds ", printable(type.substr(0, 40)), ", not ImageData, which volumes are"),
                    "in ParaView: Resample To Image");
        result_.parallel = type == "PImageData";
        result_.big_endian = a["byte_order"] == "BigEndian";
        std::string const& width = a["header_type"];
        if (!width.empty() && width != "UInt32" && width != "UInt64")
            damaged(result_.name, text("header_type=\"", printable(width.substr(0, 40)), "\" is unknown"));
        result_.wide_header = width == "UInt64";
        std::string const& compressor = a["compressor"];
        using Compressor = VtiStructure::Compressor;
        if (compressor == "vtkZLibDataCompressor")
            result_.compressor = Compressor::zlib;
        else if (compressor == "vtkLZ4DataCompressor")
            result_.compressor = Compressor::lz4;
        else if (compressor == "vtkLZMADataCompressor")
            result_.compressor = Compressor::lzma;
        else if (!compressor.empty())
            damaged(result_.name, text("its compressor, ", printable(compressor.substr(0, 60)), ", is unknown"));
    }

    void image(Attributes& a) {
        seen_ = true;
        if (auto const times = std::ssize(words_of(a["TimeValues"])); times > 1)
            damaged(result_.name, text("holds ", times, " time steps in one file, which is not read"),
                    "in ParaView: save it as a series of files, one for each time step");
        result_.whole = extent(a, "WholeExtent");
        std::vector<double> const origin = numbers(a, "Origin", 3), spacing = numbers(a, "Spacing", 3);
        std::vector<double> direction{1, 0, 0, 0, 1, 0, 0, 0, 1};
        if (a.count("Direction") > 0) direction = numbers(a, "Direction", 9);
        Geometry& g = result_.geometry;
        for (int axis = 0; axis < 3; ++axis) {
            auto const i = static_cast<std::size_t>(axis);
            g.origin[axis] = origin[i];
            double const s = spacing[i] == 0 ? 1 : spacing[i]; // of a single slice, which has no next one
            set_axis(g, axis, Vec3{direction[i], direction[3 + i], direction[6 + i]} * s,
                     text("'", result_.name, "': the direction"));
        }
    }

    void piece(Attributes& a) {
        if (!seen_) damaged(result_.name, "has a piece outside of its image");
        if (result_.pieces.size() == most_pieces) damaged(result_.name, "has more pieces than can be");
        VtiPiece p;
        p.extent = extent(a, "Extent");
        p.source = a["Source"];
        result_.pieces.push_back(std::move(p));
    }

    void array(std::string const& element, Attributes& a) {
        if (fields_) {
            keeps_text_ = a["Name"] == "vkt_header" && a["format"] == "ascii";
            text_.clear();
            return;
        }
        if (!data_) return;
        std::string const& words = a["type"];
        auto const type = type_named(words);
        bool const first = element == "PDataArray" || result_.pieces.size() <= 1;
        if (!type || element == "Array") {
            if (first) result_.not_read.push_back(text("array '", a["Name"], "' of type ", words));
            return;
        }
        VtiArray one;
        one.name = a["Name"];
        one.type = *type;
        one.cells = cells_;
        if (a.count("NumberOfComponents") > 0) {
            auto const n = integer_in(a["NumberOfComponents"]);
            if (!n || *n < 1 || *n > 65536)
                damaged(result_.name, text("array '", printable(one.name), "' has no number of components"));
            one.components = *n;
        }
        if (element == "PDataArray") {
            if (result_.declared.size() < most_arrays) result_.declared.push_back(std::move(one));
            return;
        }
        if (result_.pieces.empty() || result_.pieces.back().arrays.size() >= most_arrays)
            damaged(result_.name, "has an array outside of a piece, or too many");
        std::string const& format = a["format"];
        if (format == "appended") {
            one.format = VtiArray::Format::appended;
            auto const offset = integer_in(a["offset"]);
            if (!offset || *offset < 0) damaged(result_.name, text("array '", printable(one.name), "' has no offset"));
            one.begin = *offset;
        } else {
            if (format != "ascii" && format != "binary")
                damaged(result_.name, text("array '", printable(one.name), "' has the unknown format '",
                                           printable(format.substr(0, 40)), "'"));
            one.format = format == "ascii" ? VtiArray::Format::ascii : VtiArray::Format::binary;
            one.begin = XML_GetCurrentByteIndex(parser_) + XML_GetCurrentByteCount(parser_);
            one.end = one.begin;
            inline_ = true;
            numbers_ = ended_ = false;
            array_depth_ = depth_;
        }
        result_.pieces.back().arrays.push_back(std::move(one));
    }

    void appended(Attributes& a) {
        std::string const& encoding = a["encoding"];
        if (encoding != "raw" && encoding != "base64")
            damaged(result_.name,
                    text("its appended data have the unknown encoding '", printable(encoding.substr(0, 40)), "'"));
        result_.appended_base64 = encoding == "base64";
        std::int64_t at = XML_GetCurrentByteIndex(parser_) + XML_GetCurrentByteCount(parser_);
        // What follows need not be XML.
        stopped_ = true;
        XML_StopParser(parser_, XML_FALSE);
        for (int i = 0; i < 4096 && at < bytes_.size(); ++i, ++at) {
            char c = 0;
            bytes_.read_at(at, &c, 1);
            if (c == '_') {
                result_.appended = at + 1;
                return;
            }
            if (c != ' ' && (c < '\t' || c > '\r')) break;
        }
        damaged(result_.name, "its appended data do not begin with '_'");
    }

    /// Characters as numbers, which is how VTK writes strings.
    void ours() {
        keeps_text_ = false;
        std::string json;
        for (std::string const& word : words_of(text_)) {
            auto const c = integer_in(word);
            if (!c || *c < 0 || *c > 255) return;
            if (*c == 0) break;
            json += static_cast<char>(*c);
        }
        try {
            result_.ours = header_from_json(json);
        } catch (Error const&) { // another program has changed it
        }
    }

    void finish() {
        if (!seen_) damaged(result_.name, "has no image");
        if (result_.pieces.empty()) damaged(result_.name, "has no piece");
    }

    ByteSource& bytes_;
    VtiStructure result_;
    XML_Parser parser_ = nullptr;
    std::exception_ptr failure_;
    int depth_ = 0, array_depth_ = 0;
    bool numbers_ = false, ended_ = false; ///< of an array that lies inline: begun, over
    bool seen_ = false, data_ = false, cells_ = false, fields_ = false, inline_ = false, keeps_text_ = false,
         stopped_ = false;
    std::string text_;
};

#endif

} // namespace

bool is_vti(std::string_view head) {
    std::size_t const at = head.find("<VTKFile");
    if (at == std::string_view::npos) return false;
    std::size_t const end = head.find('>', at);
    std::string_view const tag = head.substr(at, end == std::string_view::npos ? end : end - at);
    return tag.find("ImageData\"") != std::string_view::npos || tag.find("ImageData'") != std::string_view::npos;
}

VtiStructure read_vti_structure(ByteSource& bytes) {
#ifdef VKT_HAVE_EXPAT
    return StructureReader(bytes).read();
#else
    throw Error(ErrorKind::failure, text("'", bytes.name(), "': this build cannot read VTK's XML files"),
                "build vkt with libexpat1-dev");
#endif
}

} // namespace vkt
