// Reading DICOM with GDCM.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/dicom.h"
#include "libvkt/formats/dicom_module.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"

#include <gdcmAttribute.h>
#include <gdcmGlobal.h>
#include <gdcmImageReader.h>
#include <gdcmReader.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmTag.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <tuple>
#include <type_traits>

namespace vkt::dicom {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_files = std::size_t{1} << 20;
/// Relative to the distance of slices: what rounding in decimal strings may leave.
constexpr double gap_tolerance = 0.01, slant_tolerance = 0.002;

gdcm::Tag const pixel_data(0x7fe0, 0x0010);

/// As text for messages, to a tenth of a micrometre.
std::string millimetres(double distance) { return text(std::round(distance * 1e4) / 1e4, " mm"); }

/// One plane of voxels.
struct Slice {
    std::string file; ///< its name in the folder, or empty for the file itself
    std::int64_t frame = 0, frames = 1;
    std::string series, series_number, modality, photometric, rescale_type, units, uid;
    bool table = false, mosaic = false;      ///< values have a modality LUT; slices stand side by side in an image
    std::string stack;                       ///< of frames: those of other stacks are other volumes
    std::vector<double> order;               ///< of frames: those at the same place follow one another by this
    std::size_t counted = 0;                 ///< of `order`: numbers of dimensions, the same at every place
    std::map<std::string, std::string> told; ///< of frames: what says which volume it is
    std::int64_t columns = 0, rows = 0, bits = 0, stored = 0, samples = 1, instance = 0, time = 0;
    bool is_signed = false, placed = false;
    /// Where its pixels begin in the file, if no library needs to decode them: as they are, or in runs, one fragment
    /// for each frame.
    std::int64_t pixels_at = -1;
    bool runs = false, big_endian = false, words = false, planar = false;
    Vec3 position, across{1, 0, 0}, down{0, 1, 0};
    double spacing_across = 1, spacing_down = 1;
    std::optional<double> spacing_slices;
    double slope = 1, intercept = 0;
    double along = 0; ///< position along the normal
};

std::string element_text(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return {};
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetPointer() == nullptr) return {};
    std::string words(value->GetPointer(), value->GetLength());
    while (!words.empty() && (words.back() == ' ' || words.back() == '\0')) words.pop_back();
    return words;
}

std::vector<double> element_numbers(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    std::vector<double> values;
    for (std::string const& word : split(element_text(set, group, element), '\\')) {
        auto const value = number_in(trimmed(word));
        if (!value || !std::isfinite(*value)) return {};
        values.push_back(*value);
    }
    return values;
}

/// Binary elements of two bytes, in this machine's order as GDCM hands them out.
std::int64_t element_short(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element,
                           std::int64_t otherwise) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return otherwise;
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetLength() < 2) return otherwise;
    std::uint16_t number = 0;
    std::memcpy(&number, value->GetPointer(), 2);
    return number;
}

/// The same of four bytes.
std::optional<std::uint32_t> element_long(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return std::nullopt;
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetLength() != 4) return std::nullopt;
    std::uint32_t number = 0;
    std::memcpy(&number, value->GetPointer(), 4);
    return number;
}

/// Elements of some binary numbers.
template <class T> std::vector<T> element_values(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return {};
    gdcm::ByteValue const* const value = set.GetDataElement(tag).GetByteValue();
    if (value == nullptr || value->GetPointer() == nullptr || value->GetLength() % sizeof(T) != 0) return {};
    std::vector<T> values(value->GetLength() / sizeof(T));
    std::memcpy(values.data(), value->GetPointer(), value->GetLength());
    return values;
}

gdcm::SmartPointer<gdcm::SequenceOfItems> sequence(gdcm::DataSet const& set, std::uint16_t group,
                                                   std::uint16_t element) {
    gdcm::Tag const tag(group, element);
    if (!set.FindDataElement(tag)) return nullptr;
    return set.GetDataElement(tag).GetValueAsSQ();
}

std::optional<gdcm::DataSet> first_item(gdcm::DataSet const& set, std::uint16_t group, std::uint16_t element) {
    auto const items = sequence(set, group, element);
    if (items == nullptr || items->GetNumberOfItems() == 0) return std::nullopt;
    return items->GetItem(1).GetNestedDataSet();
}

/// Place, spacing and values, from the elements of a classic file or of a functional group.
void read_plane(gdcm::DataSet const& set, Slice& slice) {
    if (auto const v = element_numbers(set, 0x0020, 0x0032); v.size() == 3) {
        slice.position = {v[0], v[1], v[2]};
        slice.placed = true;
    }
    if (auto const v = element_numbers(set, 0x0020, 0x0037); v.size() == 6) {
        Vec3 const across{v[0], v[1], v[2]}, down{v[3], v[4], v[5]};
        if (length(across) > 0.5 && length(down) > 0.5 && length(cross(across, down)) > 0.5) {
            slice.across = across * (1 / length(across));
            slice.down = down * (1 / length(down));
        }
    }
    auto spacing = element_numbers(set, 0x0028, 0x0030);
    if (spacing.size() != 2) spacing = element_numbers(set, 0x0018, 0x1164); // of projections, at the detector
    if (spacing.size() == 2 && spacing[0] > 0 && spacing[1] > 0) {
        slice.spacing_down = spacing[0];
        slice.spacing_across = spacing[1];
    }
    for (std::uint16_t const element : {std::uint16_t{0x0088}, std::uint16_t{0x0050}}) // between slices, else thickness
        if (auto const v = element_numbers(set, 0x0018, element); v.size() == 1 && v[0] != 0 && !slice.spacing_slices)
            slice.spacing_slices = std::abs(v[0]);
    auto const slope = element_numbers(set, 0x0028, 0x1053), intercept = element_numbers(set, 0x0028, 0x1052);
    if (slope.size() == 1 && slope[0] != 0) slice.slope = slope[0];
    if (intercept.size() == 1) slice.intercept = intercept[0];
    if (std::string const type = element_text(set, 0x0028, 0x1054); !type.empty()) slice.rescale_type = type;
}

/// What dimensions of frames count (Dimension Index Sequence), in the order of their significance.
enum class Dimension { place, stack, other };

std::vector<Dimension> dimensions_of(gdcm::DataSet const& set) {
    std::vector<Dimension> dimensions;
    auto const items = sequence(set, 0x0020, 0x9222);
    for (std::size_t i = 1; items != nullptr && i <= items->GetNumberOfItems(); ++i) {
        auto const tag = element_values<std::uint16_t>(items->GetItem(i).GetNestedDataSet(), 0x0020, 0x9165);
        std::uint32_t const pointer = tag.size() == 2 ? std::uint32_t{tag[0]} << 16 | tag[1] : 0;
        switch (pointer) {
        case 0x00209056: // stack, segment
        case 0x0062000b:
            dimensions.push_back(Dimension::stack);
            break;
        case 0x00209057: // position in the stack, of the image in space or in the volume, of the slice
        case 0x00200032:
        case 0x00209301:
        case 0x00201041:
            dimensions.push_back(Dimension::place);
            break;
        default:
            dimensions.push_back(Dimension::other);
        }
    }
    return dimensions;
}

void read_group(gdcm::DataSet const& group, Slice& slice) {
    for (auto const& [g, e] : {std::pair<std::uint16_t, std::uint16_t>{0x0020, 0x9113},
                               {0x0020, 0x9116},
                               {0x0028, 0x9110},
                               {0x0028, 0x9145}})
        if (auto const item = first_item(group, g, e)) read_plane(*item, slice);
}

/// To which volume a frame belongs: its stack or segment, its indices of dimensions that are no places, and without
/// those the values that such dimensions count.
void read_membership(gdcm::DataSet const& group, std::vector<Dimension> const& dimensions, Slice& slice) {
    std::vector<double> values;
    auto const number = [&](gdcm::DataSet const& set, std::uint16_t g, std::uint16_t e, char const* name) {
        auto v = element_values<double>(set, g, e);
        if (v.empty()) // phases
            for (float const value : element_values<float>(set, g, e)) v.push_back(double{value});
        bool const there = v.size() == 1 && std::isfinite(v[0]);
        if (there) slice.told[name] = to_text(v[0]);
        values.push_back(there ? v[0] : 0);
    };
    if (auto const item = first_item(group, 0x0018, 0x9117)) { // diffusion
        number(*item, 0x0018, 0x9087, "b value");
        if (auto const gradient = first_item(*item, 0x0018, 0x9076)) {
            auto const v = element_values<double>(*gradient, 0x0018, 0x9089);
            if (v.size() == 3) {
                slice.told["gradient direction"] = text(v[0], " ", v[1], " ", v[2]);
                values.insert(values.end(), v.begin(), v.end());
            }
        }
    }
    values.resize(4);
    auto const of = [&](std::uint16_t g, std::uint16_t e, std::uint16_t ge, std::uint16_t ee, char const* name) {
        if (auto const item = first_item(group, g, e))
            number(*item, ge, ee, name);
        else
            values.push_back(0);
    };
    of(0x0018, 0x9114, 0x0018, 0x9082, "echo time");
    of(0x0018, 0x9118, 0x0020, 0x9241, "cardiac phase");
    of(0x0020, 0x9253, 0x0020, 0x9245, "respiratory phase");
    std::vector<std::uint32_t> indices;
    if (auto const item = first_item(group, 0x0020, 0x9111)) { // frame content
        if (auto const index = element_long(*item, 0x0020, 0x9128)) slice.time = std::int64_t{*index};
        slice.stack = std::string(trimmed(element_text(*item, 0x0020, 0x9056)));
        indices = element_values<std::uint32_t>(*item, 0x0020, 0x9157);
    }
    if (auto const item = first_item(group, 0x0062, 0x000a)) // segment
        if (auto const segment = element_short(*item, 0x0062, 0x000b, 0); segment > 0) slice.stack = to_text(segment);
    slice.order.clear();
    if (indices.size() == dimensions.size())
        for (std::size_t i = 0; i < indices.size(); ++i)
            if (dimensions[i] == Dimension::other) slice.order.push_back(indices[i]);
    slice.order.push_back(static_cast<double>(slice.time));
    slice.counted = slice.order.size();
    slice.order.insert(slice.order.end(), values.begin(), values.end());
}

/// Whether the elements of a file end where they say, up to its pixels: GDCM may end the process for one that is cut
/// short among them. What is no plain list of elements is left to GDCM.
class ElementWalk {
public:
    explicit ElementWalk(std::istream& stream) : stream_(stream) {
        stream_.seekg(0, std::ios::end);
        size_ = stream_.tellg();
    }
    ~ElementWalk() {
        stream_.clear();
        stream_.seekg(0);
    }
    ElementWalk(ElementWalk const&) = delete;
    ElementWalk& operator=(ElementWalk const&) = delete;

    bool whole() {
        std::int64_t at = text_at(128, 4) == "DICM" ? 132 : 0;
        // The file's own elements are explicit and little-endian; they tell of the others.
        while (fits(at, 8) && number(at, 2) == 2) {
            Element const e = element(at);
            if (!e.known) return true;
            if (number(at + 2, 2) == 0x10) {
                std::string syntax = text_at(e.value, e.length);
                syntax.erase(std::find(syntax.begin(), syntax.end(), '\0'), syntax.end());
                if (syntax == "1.2.840.10008.1.2.1.99") return true; // deflated
                next_implicit_ = syntax == "1.2.840.10008.1.2";
                next_big_ = syntax == "1.2.840.10008.1.2.2";
            }
            at = e.value + e.length;
        }
        if (at >= size_) return at == size_ && size_ > 132;
        if (at == 0 && number(0, 2) > 0xff) return true; // big-endian, and does not say so
        implicit_ = next_implicit_.value_or(!has_type(at));
        big_ = next_big_;
        return list(at, 0) != cut;
    }

private:
    static constexpr std::int64_t cut = -1, unknown = -2;
    static constexpr std::uint32_t undefined = 0xffffffff, end_of_item = 0xfffee00d, end_of_items = 0xfffee0dd,
                                   pixels = 0x7fe00010;
    struct Element {
        std::uint32_t tag = 0;
        std::int64_t value = 0, length = 0; ///< length: -1: undefined
        bool known = false;
    };

    bool fits(std::int64_t at, std::int64_t n) const { return at <= size_ && n <= size_ - at; }
    std::string text_at(std::int64_t at, std::int64_t n) {
        if (!fits(at, n) || n > 256) return {};
        std::string words(static_cast<std::size_t>(n), '\0');
        stream_.seekg(at);
        stream_.read(words.data(), n);
        return words;
    }
    std::uint32_t number(std::int64_t at, int n) {
        std::string const b = text_at(at, n);
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < b.size(); ++i)
            value = value << 8 | static_cast<unsigned char>(b[big_ ? i : b.size() - 1 - i]);
        return value;
    }
    bool has_type(std::int64_t at) {
        std::string const type = text_at(at + 4, 2);
        return type.size() == 2 && type[0] >= 'A' && type[0] <= 'Z' && type[1] >= 'A' && type[1] <= 'Z';
    }

    Element element(std::int64_t at) {
        Element e;
        e.tag = number(at, 2) << 16 | number(at + 2, 2);
        e.value = at + 8;
        std::uint32_t length = number(at + 4, 4);
        bool const typed = !implicit_ && e.tag >> 16 != 0xfffe;
        if (typed && !has_type(at)) return e;
        if (typed) {
            static constexpr std::string_view wide[] = {"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                        "SV", "UC", "UN", "UR", "UT", "UV"};
            std::string const type = text_at(at + 4, 2);
            bool const is_wide = std::find(std::begin(wide), std::end(wide), type) != std::end(wide);
            length = is_wide ? number(at + 8, 4) : number(at + 6, 2);
            if (is_wide) e.value = at + 12;
        }
        e.length = length == undefined ? -1 : std::int64_t{length};
        e.known = true;
        return e;
    }

    /// Where the list ends: at the pixels, its own end, or the file's.
    std::int64_t list(std::int64_t at, int depth) {
        if (depth > 32) return unknown;
        while (at < size_) {
            if (!fits(at, 8)) return cut;
            Element const e = element(at);
            if (!e.known) return unknown;
            if (e.tag == pixels && depth == 0) return at;
            if (e.tag == end_of_item || e.tag == end_of_items) return e.value;
            if (e.length >= 0) {
                if (!fits(e.value, e.length)) return cut;
                at = e.value + e.length;
                continue;
            }
            at = list(e.value, depth + 1); // of items, or of an item's elements
            if (at < 0) return at;
        }
        return depth == 0 ? at : cut;
    }

    std::istream& stream_;
    std::int64_t size_ = 0;
    std::optional<bool> next_implicit_;
    bool next_big_ = false, implicit_ = false, big_ = false;
};

class DicomFiles : public GridsParser {
public:
    explicit DicomFiles(std::string path) : path_(std::move(path)) {
        gdcm::Trace::DebugOff();
        gdcm::Trace::WarningOff();
        gdcm::Trace::ErrorOff();
        std::error_code error;
        folder_ = fs::is_directory(path_, error);
        base_ = path_;
    }

    ParsedGrids open(GridsChoice const& choice) override;
    void read(std::int64_t volume, Box const& box, std::byte* to) override;

private:
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", path_, "': ", what), hint);
    }
    std::string full(std::string const& file) const { return file.empty() ? path_ : base_ + "/" + file; }
    std::string shown(Slice const& s) const {
        return text(s.file.empty() ? path_ : s.file, s.frames > 1 ? text(" frame ", s.frame) : "");
    }
    /// How to have what is refused.
    std::string forced() const { return text("vkt read ", shell_quoted(path_), " --force-uniform | ..."); }
    bool read_file(std::string const& file);
    void check_pixels(std::istream& stream, gdcm::File const& file, Slice& slice) const;
    bool note_records(gdcm::DataSet const& set);
    void list_files(bool trust_paths, std::vector<std::string>& not_read);
    void list_records(bool trust_paths, std::vector<std::string>& not_read);
    void read_files(std::vector<std::string> const& names, std::vector<std::string>& not_read);
    std::vector<std::vector<Slice>> groups() const;
    void check_membership(std::vector<Slice> const& slices, std::size_t volumes) const;
    void arrange(std::vector<Slice> slices, bool force_uniform, ParsedGrids& grids);
    void place(bool force_uniform, Header& header) const;
    void tell_personal(std::string const& file, ParsedGrids& grids) const;
    std::vector<char> const& pixels(Slice const& slice);
    std::span<char const> frame_of(Slice const& slice);
    void read_plain(std::istream& stream, Slice const& slice);
    bool read_runs(std::istream& stream, Slice const& slice);
    bool single_bits(gdcm::DataSet const& set, Slice const& slice);
    void to_colours(Slice const& slice);
    template <class T>
    void copy_rows(Slice const& slice, char const* frame, Box const& box, std::int64_t sample, std::byte* to) const;

    std::string path_, base_;          ///< base_: where names of files begin
    bool folder_ = false;              ///< several files
    std::vector<std::string> records_; ///< the files that a DICOMDIR names
    std::vector<Slice> all_, slices_;  ///< found; those of the volumes, one volume after another
    Index3 dims_;
    std::int64_t samples_ = 1;
    bool physical_ = false; ///< slopes differ between slices: values are made physical
    std::string held_file_;
    std::int64_t held_frame_ = -1; ///< -1: all of them
    bool held_ = false;
    std::vector<char> pixels_;
    bool planar_ = false;
};

/// GDCM takes zeros for what a file that was cut short lacks. The stream is behind the head of the pixel data, where
/// GDCM leaves it; the four bytes before it are their length.
void DicomFiles::check_pixels(std::istream& stream, gdcm::File const& file, Slice& slice) const {
    gdcm::TransferSyntax const syntax = file.GetHeader().GetDataSetTransferSyntax();
    // Places in a deflated file are none in what it holds.
    if (syntax == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian) return;
    auto const refuse = [&](std::string const& what) {
        throw Error(ErrorKind::data, text("'", full(slice.file), "': ended early: ", what));
    };
    std::int64_t at = stream.tellg();
    stream.clear();
    stream.seekg(0, std::ios::end);
    std::int64_t const size = stream.tellg();
    bool const big = syntax == gdcm::TransferSyntax::ExplicitVRBigEndian;
    // Two numbers of 16 bits, a tag, or one of 32.
    auto const word = [&](std::int64_t position, bool tag) {
        std::array<unsigned char, 4> b{};
        stream.seekg(position);
        stream.read(reinterpret_cast<char*>(b.data()), b.size());
        auto const half = [&](std::size_t i) -> std::uint32_t {
            return big ? b[i] * 256U + b[i + 1] : b[i] + b[i + 1] * 256U;
        };
        return tag || big ? half(0) << 16 | half(2) : half(2) << 16 | half(0);
    };
    if (at < 12 || at > size || (word(at - 12, true) != 0x7fe00010 && word(at - 8, true) != 0x7fe00010))
        refuse("it has no pixels");
    std::uint32_t const length = word(at - 4, false);
    constexpr std::uint32_t undefined = 0xffffffff, item = 0xfffee000, end_of_items = 0xfffee0dd;
    if (length != undefined) {
        std::string const colours = element_text(file.GetDataSet(), 0x0028, 0x0004);
        bool const halved = colours.ends_with("_422") || colours.ends_with("_420"); // some share their chroma
        double const needed = static_cast<double>(slice.columns * slice.rows) * static_cast<double>(slice.frames) *
                              static_cast<double>(halved ? 2 : slice.samples) * static_cast<double>(slice.bits) / 8;
        if (static_cast<double>(length) < needed) refuse("it has fewer pixels than it says");
        if (length > size - at) refuse(text("pixels of ", std::int64_t{length}, " bytes, ", size - at, " found"));
        std::array<char, 2> type{};
        stream.seekg(at - 8);
        stream.read(type.data(), type.size());
        slice.words = word(at - 12, true) != 0x7fe00010 || std::string_view(type.data(), 2) != "OB";
        slice.big_endian = big;
        if (!halved && (slice.bits == 8 || slice.bits == 16 || slice.bits == 32)) slice.pixels_at = at;
        return;
    }
    slice.runs = syntax == gdcm::TransferSyntax::RLELossless;
    if (slice.runs && slice.bits % 8 == 0 && slice.bits <= 32) slice.pixels_at = at;
    while (true) {
        if (size - at < 8) refuse("its encoded pixels have no end");
        std::uint32_t const tag = word(at, true), bytes = word(at + 4, false);
        if (tag == end_of_items) return;
        if (tag != item) refuse("its encoded pixels are no fragments");
        if (bytes > size - at - 8) refuse("a fragment of its encoded pixels is incomplete");
        at += 8 + std::int64_t{bytes};
    }
}

bool DicomFiles::read_file(std::string const& file) {
    {
        // GDCM takes much for DICOM that is not: other files of a folder are left alone.
        std::ifstream in(full(file), std::ios::binary);
        std::array<char, dicom_head_bytes> head{};
        in.read(head.data(), head.size());
        auto const got = static_cast<std::size_t>(in.gcount());
        if (folder_ && !begins_as_dicom(std::as_bytes(std::span(head.data(), got)))) return false;
    }
    std::ifstream stream(full(file), std::ios::binary);
    if (!ElementWalk(stream).whole())
        throw Error(ErrorKind::data, text("'", full(file), "': ended early: it has no whole header"),
                    folder_ ? "copy it again, or remove it from the folder" : "");
    gdcm::Reader reader;
    reader.SetStream(stream);
    // Anything but the pixels.
    if (!reader.ReadUpToTag(pixel_data, {pixel_data})) {
        if (folder_) fail(text("'", file, "' is damaged, or no DICOM file"), "remove it from the folder");
        fail("damaged: GDCM cannot read it");
    }
    gdcm::DataSet const& set = reader.GetFile().GetDataSet();
    Slice s;
    s.file = file;
    s.columns = element_short(set, 0x0028, 0x0011, 0);
    s.rows = element_short(set, 0x0028, 0x0010, 0);
    if (s.columns == 0 || s.rows == 0) return note_records(set); // a report, a directory
    s.samples = element_short(set, 0x0028, 0x0002, 1);
    s.bits = element_short(set, 0x0028, 0x0100, 16);
    s.is_signed = element_short(set, 0x0028, 0x0103, 0) == 1;
    s.planar = element_short(set, 0x0028, 0x0006, 0) == 1;
    s.stored = element_short(set, 0x0028, 0x0101, s.bits);
    std::int64_t const stored = s.stored, high = element_short(set, 0x0028, 0x0102, stored - 1);
    if (stored <= high && high < s.bits) // GDCM masks the lowest bits all the same
        fail(text(folder_ ? text("'", file, "': ") : "", "its values do not end with the lowest bit (Bits Stored is ",
                  stored, ", High Bit ", high, "), which is not read"));
    for (std::uint16_t const element : {std::uint16_t{0x0008}, std::uint16_t{0x0009}})
        if (set.FindDataElement(gdcm::Tag(0x7fe0, element)))
            fail(text(folder_ ? text("'", file, "': ") : "", "its values are floats ((Double) Float Pixel Data), "
                                                             "which are not read"));
    s.series = element_text(set, 0x0020, 0x000e);
    s.series_number = std::string(trimmed(element_text(set, 0x0020, 0x0011)));
    s.modality = element_text(set, 0x0008, 0x0060);
    s.photometric = element_text(set, 0x0028, 0x0004);
    s.units = element_text(set, 0x0054, 0x1001);
    s.uid = element_text(set, 0x0008, 0x0018);
    s.table = first_item(set, 0x0028, 0x3000).has_value();
    s.mosaic = element_text(set, 0x0008, 0x0008).find("MOSAIC") != std::string::npos;
    auto const whole = [&](std::uint16_t group, std::uint16_t element) {
        auto const v = element_numbers(set, group, element);
        return v.size() == 1 ? static_cast<std::int64_t>(std::clamp(v[0], -1e15, 1e15)) : std::int64_t{0};
    };
    s.instance = whole(0x0020, 0x0013);
    s.time = whole(0x0020, 0x0100);                  // temporal position
    if (s.time == 0) s.time = whole(0x0020, 0x0012); // acquisition number
    s.frames = std::clamp<std::int64_t>(whole(0x0028, 0x0008), 1, std::int64_t{1} << 24);
    if (all_.size() + static_cast<std::size_t>(s.frames) > most_files) fail("holds more images than vkt reads at once");
    check_pixels(stream, reader.GetFile(), s);
    read_plane(set, s);
    if (!s.placed) // of nuclear medicine, where the frames of a detector lie
        if (auto const detector = first_item(set, 0x0054, 0x0022)) read_plane(*detector, s);
    // Doses have a slope and places of frames of their own: distances from the first, or, if that is not 0, along z.
    if (auto const v = element_numbers(set, 0x3004, 0x000e); v.size() == 1 && v[0] != 0) s.slope = v[0];
    if (s.units.empty()) s.units = element_text(set, 0x3004, 0x0002);
    auto const offsets = element_numbers(set, 0x3004, 0x000c);
    if (auto const shared = first_item(set, 0x5200, 0x9229)) read_group(*shared, s);
    auto const frames = sequence(set, 0x5200, 0x9230);
    std::vector<Dimension> const dimensions = dimensions_of(set);
    Vec3 const normal = cross(s.across, s.down);
    for (std::int64_t f = 0; f < s.frames; ++f) {
        Slice one = s;
        one.frame = f;
        bool grouped = false;
        if (frames != nullptr && static_cast<std::int64_t>(frames->GetNumberOfItems()) > f) {
            auto const& group = frames->GetItem(static_cast<gdcm::SequenceOfItems::SizeType>(f) + 1).GetNestedDataSet();
            read_group(group, one);
            read_membership(group, dimensions, one);
            grouped = one.placed;
        }
        // Frames without places of their own follow one another.
        if (!grouped && s.frames > 1 && std::ssize(offsets) == s.frames)
            one.position = s.position + (offsets[0] == 0 ? normal : Vec3{0, 0, 1}) *
                                            (offsets[static_cast<std::size_t>(f)] - offsets[0]);
        else if (!grouped && s.frames > 1)
            one.position = s.position + normal * (static_cast<double>(f) * s.spacing_slices.value_or(1));
        if (s.frames > 1) one.placed = true;
        all_.push_back(one);
    }
    return true;
}

/// Of a DICOMDIR, the files that it names. It is no image itself.
bool DicomFiles::note_records(gdcm::DataSet const& set) {
    auto const records = sequence(set, 0x0004, 0x1220);
    for (std::size_t i = 1; records != nullptr && i <= records->GetNumberOfItems(); ++i) {
        gdcm::DataSet const& record = records->GetItem(i).GetNestedDataSet();
        std::string const name = element_text(record, 0x0004, 0x1500);
        std::vector<std::string> parts = split(name, '\\');
        for (std::string& part : parts) part = std::string(trimmed(part));
        if (!name.empty() && records_.size() < most_files) records_.push_back(join(parts, "/"));
    }
    return false;
}

void DicomFiles::list_files(bool trust_paths, std::vector<std::string>& not_read) {
    if (!folder_) {
        if (read_file("")) return;
        if (records_.empty()) fail("holds no image");
        std::error_code error;
        fs::path const place = fs::read_symlink(path_, error); // it is handed over open
        base_ = (error ? fs::path(path_) : place).parent_path().string();
        if (base_.empty()) base_ = ".";
        folder_ = true;
        return list_records(trust_paths, not_read);
    }
    std::vector<std::string> names;
    std::error_code error;
    for (auto const& entry : fs::directory_iterator(path_, error))
        if (entry.is_regular_file(error)) names.push_back(entry.path().filename());
    if (names.size() > most_files) fail("holds more files than vkt reads at once");
    std::sort(names.begin(), names.end());
    read_files(names, not_read);
    if (all_.empty() && !records_.empty()) {
        not_read.clear();
        list_records(trust_paths, not_read);
    }
    if (all_.empty()) fail("holds no DICOM images");
}

/// Names are those of a disc, whose files may have got small letters since.
void DicomFiles::list_records(bool trust_paths, std::vector<std::string>& not_read) {
    std::vector<std::string> names;
    std::int64_t absent = 0;
    std::error_code error;
    for (std::string const& name : records_) {
        bool found = false;
        for (std::string const& spelt : {name, lower_case(name)}) {
            if (found || !fs::exists(beside(base_ + "/DICOMDIR", spelt, trust_paths), error)) continue;
            names.push_back(spelt);
            found = true;
        }
        if (!found) ++absent;
    }
    read_files(names, not_read);
    if (absent > 0)
        not_read.push_back(text(absent, absent == 1 ? " file" : " files", " named by the DICOMDIR, but not there"));
    if (all_.empty()) fail("its DICOMDIR names no image that is there", "read the folder with the images itself");
}

void DicomFiles::read_files(std::vector<std::string> const& names, std::vector<std::string>& not_read) {
    std::int64_t others = 0, copies = 0;
    std::set<std::tuple<std::string, std::string, std::int64_t>> seen;
    for (std::string const& name : names) {
        std::size_t const before = all_.size();
        if (!read_file(name)) {
            ++others;
            continue;
        }
        Slice const& image = all_[before];
        if (image.uid.empty() || seen.insert({image.uid, image.series, image.instance}).second) continue;
        all_.resize(before);
        ++copies;
    }
    if (copies > 0)
        not_read.push_back(text(copies, copies == 1 ? " copy" : " copies", " of images that are there already"));
    if (others > 0) not_read.push_back(text(others, " files that are no DICOM images"));
}

/// Images that can be slices of one volume, but for the stacks that they are of.
bool alike(Slice const& a, Slice const& b) {
    return a.series == b.series && a.columns == b.columns && a.rows == b.rows && a.samples == b.samples &&
           a.bits == b.bits && a.is_signed == b.is_signed && dot(a.across, b.across) > 1 - 1e-4 &&
           dot(a.down, b.down) > 1 - 1e-4 && std::abs(a.spacing_across - b.spacing_across) <= 1e-4 * a.spacing_across &&
           std::abs(a.spacing_down - b.spacing_down) <= 1e-4 * a.spacing_down;
}

/// Where slices of one orientation lie, each place once, in order: along the normal, across and down.
std::vector<std::array<double, 3>> places_of(std::vector<Slice> const& slices) {
    Slice const& first = slices.front();
    Vec3 const normal = cross(first.across, first.down);
    std::vector<std::array<double, 3>> places;
    for (Slice const& s : slices)
        places.push_back({dot(s.position, normal), dot(s.position, first.across), dot(s.position, first.down)});
    std::sort(places.begin(), places.end());
    auto const same = [](auto const& a, auto const& b) { return std::abs(a[0] - b[0]) <= 1e-4; };
    places.erase(std::unique(places.begin(), places.end(), same), places.end());
    return places;
}

bool same_places(std::vector<Slice> const& a, std::vector<Slice> const& b) {
    auto const one = places_of(a), other = places_of(b);
    return std::equal(one.begin(), one.end(), other.begin(), other.end(), [](auto const& p, auto const& q) {
        return std::abs(p[0] - q[0]) <= 1e-3 && std::abs(p[1] - q[1]) <= 1e-3 && std::abs(p[2] - q[2]) <= 1e-3;
    });
}

/// Stacks in the same places are volumes of one series, in the order of their numbers; where every stack is one place
/// they are the slices of a volume; others stay by themselves.
std::vector<std::vector<Slice>> joined_stacks(std::vector<std::vector<Slice>> stacks) {
    if (stacks.size() == 1) return stacks;
    auto const number = [](std::vector<Slice> const& stack) { return number_in(stack.front().stack).value_or(0); };
    std::stable_sort(stacks.begin(), stacks.end(), [&](auto const& a, auto const& b) { return number(a) < number(b); });
    std::vector<std::vector<Slice>> result;
    bool const single =
        std::all_of(stacks.begin(), stacks.end(), [](auto const& stack) { return places_of(stack).size() == 1; });
    if (single && !same_places(stacks.front(), stacks.back())) {
        for (std::size_t i = 1; i < stacks.size(); ++i)
            stacks[0].insert(stacks[0].end(), stacks[i].begin(), stacks[i].end());
        result.push_back(std::move(stacks[0]));
        return result;
    }
    for (std::size_t i = 0; i < stacks.size(); ++i) {
        for (Slice& s : stacks[i]) {
            s.order.insert(s.order.begin(), static_cast<double>(i));
            ++s.counted;
            s.told[s.modality == "SEG" ? "segment" : "stack"] = s.stack;
        }
        auto const found = std::find_if(result.begin(), result.end(),
                                        [&](auto const& group) { return same_places(group, stacks[i]); });
        if (found == result.end())
            result.push_back(std::move(stacks[i]));
        else
            found->insert(found->end(), stacks[i].begin(), stacks[i].end());
    }
    return result;
}

/// Of which stack they are, for a list, if they are of one.
std::string stack_text(std::vector<Slice> const& slices) {
    std::string const& stack = slices.front().stack;
    bool const one = std::all_of(slices.begin(), slices.end(), [&](Slice const& s) { return s.stack == stack; });
    return one && !stack.empty() ? text(slices.front().modality == "SEG" ? ", segment " : ", stack ", stack) : "";
}

/// Images that can be slices of one volume, or of several in the same places.
std::vector<std::vector<Slice>> DicomFiles::groups() const {
    // Those that are alike, and of those, each stack.
    std::vector<std::vector<std::vector<Slice>>> kinds;
    for (Slice const& slice : all_) {
        auto kind = std::find_if(kinds.begin(), kinds.end(),
                                 [&](auto const& stacks) { return alike(stacks.front().front(), slice); });
        if (kind == kinds.end()) kind = kinds.emplace(kinds.end());
        auto const stack = std::find_if(kind->begin(), kind->end(),
                                        [&](auto const& group) { return group.front().stack == slice.stack; });
        if (stack == kind->end())
            kind->push_back({slice});
        else
            stack->push_back(slice);
    }
    std::vector<std::vector<Slice>> result;
    for (auto& stacks : kinds)
        for (auto& group : joined_stacks(std::move(stacks))) result.push_back(std::move(group));
    return result;
}

/// Whether what stands in the same row at every place is of the same volume: where one place lacks a frame of the first
/// volume and another one of the second, they would be mixed.
void DicomFiles::check_membership(std::vector<Slice> const& slices, std::size_t volumes) const {
    if (volumes < 2) return;
    // What differs between all of them is a number of the frame and no dimension.
    std::size_t const counted = slices.front().counted;
    std::vector<bool> running(counted);
    for (std::size_t d = 0; d < counted; ++d) {
        std::set<double> values;
        for (Slice const& s : slices)
            if (d < s.order.size()) values.insert(s.order[d]);
        running[d] = values.size() == slices.size();
    }
    for (std::size_t i = volumes; i < slices.size(); ++i) {
        Slice const &a = slices[i % volumes], &b = slices[i];
        bool same = a.counted == b.counted && a.told.contains("b value") == b.told.contains("b value") &&
                    (!a.told.contains("b value") || a.told.at("b value") == b.told.at("b value"));
        for (std::size_t d = 0; same && d < counted; ++d) same = running[d] || a.order[d] == b.order[d];
        if (!same)
            fail(text("its frames do not make whole volumes: at one place there is none like ", shown(a),
                      ", and at another none like ", shown(b)),
                 text("in the order that they have at each place all the same: ", forced()));
    }
}

/// Sorts the slices into volumes.
void DicomFiles::arrange(std::vector<Slice> slices, bool force_uniform, ParsedGrids& grids) {
    Slice const first = slices.front();
    Vec3 const normal = cross(first.across, first.down);
    bool const placed = std::all_of(slices.begin(), slices.end(), [](Slice const& s) { return s.placed; });
    if (!placed && slices.size() > 1 && !force_uniform)
        fail("its images do not say where they lie (Image Position (Patient))",
             text("in the order of their numbers all the same: ", forced()));
    for (Slice& s : slices) s.along = placed ? dot(s.position, normal) : static_cast<double>(s.instance);
    std::stable_sort(slices.begin(), slices.end(), [](Slice const& a, Slice const& b) {
        if (std::abs(a.along - b.along) > 1e-4) return a.along < b.along;
        return std::tie(a.order, a.time, a.instance, a.frame) < std::tie(b.order, b.time, b.instance, b.frame);
    });
    // How often each place occurs.
    std::vector<std::size_t> runs{1};
    for (std::size_t i = 1; i < slices.size(); ++i)
        if (std::abs(slices[i].along - slices[i - 1].along) <= 1e-4)
            ++runs.back();
        else
            runs.push_back(1);
    for (std::size_t i = 0, k = 0; i < runs.size(); k += runs[i++])
        if (runs[i] != runs[0])
            fail(text("its images lie in the same places unequally often: ", static_cast<std::int64_t>(runs[0]),
                      " times at ", shown(slices.front()), ", ", static_cast<std::int64_t>(runs[i]), " times at ",
                      shown(slices[k])),
                 folder_ ? "put the images of one volume into a folder of their own"
                         : "some of its frames are missing: copy it again from where it was made");
    std::size_t const volumes = runs[0], n = runs.size();
    if (!force_uniform) check_membership(slices, volumes);
    for (std::size_t v = 0; v < volumes; ++v)
        for (std::size_t z = 0; z < n; ++z) slices_.push_back(slices[z * volumes + v]);
    dims_ = {first.columns, first.rows, static_cast<std::int64_t>(n)};
    samples_ = first.samples;
    grids.volumes = static_cast<std::int64_t>(volumes) * samples_;
    static char const* const rgb[] = {"red", "green", "blue"};
    if (grids.volumes > 1)
        for (std::size_t v = 0; v < volumes; ++v)
            for (std::int64_t s = 0; s < samples_; ++s) {
                std::map<std::string, std::string> said;
                if (volumes > 1) {
                    said["sequence position"] = to_text(static_cast<std::int64_t>(v));
                    said["sequence step"] = "1";
                }
                for (auto const& [what, value] : slices_[v * n].told)
                    if (auto const& other = slices_[v > 0 ? 0 : (volumes - 1) * n].told; // what is the same is no news
                        volumes > 1 && (!other.contains(what) || other.at(what) != value))
                        said[what] = value;
                if (samples_ > 1) said["channel"] = s < 3 ? rgb[s] : to_text(s);
                grids.attributes.push_back(std::move(said));
            }
    grids.header.dims = dims_;
    if (placed)
        place(force_uniform, grids.header);
    else
        grids.header.geometry.spacing = {first.spacing_across, first.spacing_down, first.spacing_slices.value_or(1)};
}

void DicomFiles::place(bool force_uniform, Header& header) const {
    Slice const &first = slices_.front(), &last = slices_[static_cast<std::size_t>(dims_.z - 1)];
    Vec3 const normal = cross(first.across, first.down);
    Geometry& g = header.geometry;
    g.origin = first.position;
    g.direction = {first.across, first.down, normal};
    g.spacing = {first.spacing_across, first.spacing_down, first.spacing_slices.value_or(1)};
    header.attributes["space"] = std::string(lps_frame);
    header.attributes["space units"] = "\"mm\" \"mm\" \"mm\"";
    if (dims_.z > 1) {
        Vec3 const step = (last.position - first.position) * (1 / static_cast<double>(dims_.z - 1));
        double mean = dot(step, normal);
        // Where they are as far apart as the file says, but for the rounding of their places.
        if (double const said = first.spacing_slices.value_or(0); std::abs(mean - said) <= 1e-6 * mean) mean = said;
        g.spacing.z = mean;
        Vec3 const aside = step - normal * mean;
        if (length(aside) > slant_tolerance * mean) {
            if (!force_uniform)
                fail(text("its slices lie on a slant: each is ", millimetres(length(aside)),
                          " aside of the one before it, ", millimetres(mean), " further (a tilted gantry)"),
                     text("as a sheared lattice, with every voxel in its place: ", forced()));
            set_axis(g, 2, step, "the distance of slices");
        }
        for (std::int64_t z = 1; z < dims_.z; ++z) {
            Slice const &a = slices_[static_cast<std::size_t>(z - 1)], &b = slices_[static_cast<std::size_t>(z)];
            double const here = b.along - a.along;
            if (std::abs(here - mean) <= gap_tolerance * mean || force_uniform) continue;
            // Most distances say what is usual.
            std::vector<double> distances;
            for (std::int64_t i = 1; i < dims_.z; ++i)
                distances.push_back(slices_[static_cast<std::size_t>(i)].along -
                                    slices_[static_cast<std::size_t>(i - 1)].along);
            std::nth_element(distances.begin(), distances.begin() + std::ssize(distances) / 2, distances.end());
            double const usual = distances[distances.size() / 2];
            for (std::int64_t i = 1; i < dims_.z; ++i) {
                Slice const &c = slices_[static_cast<std::size_t>(i - 1)], &d = slices_[static_cast<std::size_t>(i)];
                if (std::abs(d.along - c.along - usual) > gap_tolerance * usual)
                    fail(text("its slices lie at unequal distances: ", millimetres(d.along - c.along), " from ",
                              shown(c), " to ", shown(d), ", ", millimetres(usual), " elsewhere"),
                         text("as if all were equal, at their mean: ", forced()));
            }
        }
    }
    for (auto& direction : g.direction) direction = direction + Vec3{}; // no negative zeros
}

ParsedGrids DicomFiles::open(GridsChoice const& choice) {
    std::string const& variable = choice.variable;
    ParsedGrids grids;
    list_files(choice.trust_paths, grids.not_read);
    std::vector<std::vector<Slice>> series = groups();
    // Named by the number of the series; what has none, or shares it, by place.
    std::vector<std::string> names;
    for (auto const& group : series) {
        std::string name = group.front().series_number.empty() ? "series" : group.front().series_number;
        std::string const base = name;
        for (int k = 2; std::find(names.begin(), names.end(), name) != names.end(); ++k) name = text(base, "-", k);
        names.push_back(name);
    }
    std::size_t chosen = 0;
    if (!variable.empty()) {
        auto const found = std::find(names.begin(), names.end(), variable);
        if (found == names.end())
            throw Error(ErrorKind::usage,
                        text("'", path_, "' has no series '", variable, "'; it holds ", join(names, ", ")));
        chosen = static_cast<std::size_t>(found - names.begin());
    } else if (series.size() > 1) {
        for (std::size_t i = 0; i < series.size(); ++i)
            grids.choices.emplace_back(names[i], text(series[i].front().modality, stack_text(series[i]), ", ",
                                                      std::ssize(series[i]), " images of ", series[i].front().columns,
                                                      " by ", series[i].front().rows));
    }
    Slice const first = series[chosen].front();
    physical_ = std::any_of(series[chosen].begin(), series[chosen].end(),
                            [&](Slice const& s) { return s.slope != first.slope || s.intercept != first.intercept; });
    // Of several nobody chose yet, the first stands for all, whatever its slices are like.
    arrange(series[chosen], choice.force_uniform || !grids.choices.empty(), grids);
    Header& header = grids.header;
    if (first.bits != 1 && first.bits != 8 && first.bits != 12 && first.bits != 16 && first.bits != 32)
        fail(text("its values have ", first.bits, " bits, which vkt does not read"));
    header.dtype = first.bits <= 8    ? (first.is_signed ? DataType::int8 : DataType::uint8)
                   : first.bits <= 16 ? (first.is_signed ? DataType::int16 : DataType::uint16)
                                      : (first.is_signed ? DataType::int32 : DataType::uint32);
    if (physical_) {
        bool const wide = first.bits > 16; // whose values float32 does not hold
        header.dtype = wide ? DataType::float64 : DataType::float32;
        double largest = 0;
        for (Slice const& s : series[chosen])
            largest =
                std::max(largest, std::ldexp(std::abs(s.slope), static_cast<int>(s.bits)) + std::abs(s.intercept));
        header.error.kind = largest < 1e38 ? Certainty::bound : Certainty::unknown; // of rounding to that
        header.error.at_most = largest < 1e38 ? largest * (wide ? 0x1p-52 : 0x1p-23) : 0;
    } else {
        header.values = {first.slope, first.intercept};
    }
    if (!first.modality.empty()) header.attributes["modality"] = first.modality;
    if (first.photometric == "MONOCHROME1") header.attributes["photometric"] = "min is white";
    if (first.photometric == "PALETTE COLOR") header.attributes["photometric"] = "palette";
    if (first.table) grids.not_read.push_back("the modality LUT, which says what its values mean: they are as stored");
    if (first.mosaic)
        grids.not_read.push_back(
            "the places of slices in a mosaic: they stand side by side, dcm2niix takes them apart");
    header.units = first.table                   ? ""
                   : !first.rescale_type.empty() ? (first.rescale_type == "US" ? "" : first.rescale_type)
                   : first.modality == "CT"      ? "HU"
                                                 : first.units;
    if (choice.personal) tell_personal(first.file, grids);
    header = in_utf8(std::move(header));
    return grids;
}

/// What the first image says of the patient and the examination.
void DicomFiles::tell_personal(std::string const& file, ParsedGrids& grids) const {
    std::ifstream stream(full(file), std::ios::binary);
    gdcm::Reader reader;
    reader.SetStream(stream);
    if (!reader.ReadUpToTag(pixel_data, {pixel_data})) fail("changed while it was read");
    gdcm::DataSet const& set = reader.GetFile().GetDataSet();
    std::string const characters = element_text(set, 0x0008, 0x0005);
    bool const known =
        characters.empty() || characters == "ISO_IR 6" || characters == "ISO_IR 100" || characters == "ISO_IR 192";
    struct Element {
        std::uint16_t group, element;
        char const* name;
    };
    static constexpr Element elements[] = {
        {0x0010, 0x0010, "patient name"},       {0x0010, 0x0020, "patient id"},
        {0x0010, 0x0030, "patient birth date"}, {0x0010, 0x0040, "patient sex"},
        {0x0010, 0x1010, "patient age"},        {0x0010, 0x1030, "patient weight"},
        {0x0008, 0x0020, "study date"},         {0x0008, 0x0030, "study time"},
        {0x0008, 0x1030, "study description"},  {0x0008, 0x103e, "series description"},
        {0x0018, 0x0015, "body part"},          {0x0018, 0x1030, "protocol"},
        {0x0008, 0x0070, "manufacturer"},       {0x0008, 0x1090, "model"},
        {0x0008, 0x0080, "institution"},        {0x0008, 0x0090, "referring physician"},
        {0x0008, 0x0050, "accession number"},   {0x0020, 0x000d, "study uid"},
        {0x0020, 0x000e, "series uid"},         {0x0020, 0x0052, "frame of reference uid"},
    };
    for (auto const& [group, element, name] : elements) {
        std::string words = element_text(set, group, element);
        std::replace_if(
            words.begin(), words.end(), [](unsigned char c) { return c < ' ' || c == 127; }, ' ');
        bool const plain = std::all_of(words.begin(), words.end(), [](unsigned char c) { return c < 128; });
        if (words.empty()) continue;
        if (known || plain)
            grids.header.attributes[name] = words;
        else
            grids.not_read.push_back(text(name, ", which is written in ", printable(characters)));
    }
}

/// Bits of all frames, one after another from the lowest of the first byte on (PS3.5, 8.1.1), as a byte each.
bool DicomFiles::single_bits(gdcm::DataSet const& set, Slice const& slice) {
    gdcm::ByteValue const* const value =
        set.FindDataElement(pixel_data) ? set.GetDataElement(pixel_data).GetByteValue() : nullptr;
    auto const count = static_cast<std::size_t>(slice.columns * slice.rows * slice.samples * slice.frames);
    if (value == nullptr || value->GetPointer() == nullptr || value->GetLength() < (count + 7) / 8) return false;
    pixels_.resize(count);
    for (std::size_t i = 0; i < count; ++i)
        pixels_[i] = static_cast<char>(static_cast<unsigned char>(value->GetPointer()[i / 8]) >> (i % 8) & 1);
    planar_ = false;
    return true;
}

/// Luma and two differences of colour as red, green and blue (PS3.3, C.7.6.3.1.2): the three bytes of a pixel are
/// `apart` from one another.
void luma_to_rgb(std::vector<char>& pixels, std::size_t apart) {
    auto const rounded = [](double v) {
        return static_cast<char>(static_cast<unsigned char>(std::clamp(std::floor(v + 0.5), 0.0, 255.0)));
    };
    for (std::size_t group = 0; group + 3 * apart <= pixels.size(); group += 3 * apart)
        for (std::size_t i = group; i < group + apart; ++i) {
            auto const value = [&](std::size_t k) {
                return static_cast<double>(static_cast<unsigned char>(pixels[i + k * apart]));
            };
            double const luma = value(0), blue = value(1) - 128, red = value(2) - 128;
            pixels[i] = rounded(luma + 1.402 * red);
            pixels[i + apart] = rounded(luma - 0.114 * 1.772 / 0.587 * blue - 0.299 * 1.402 / 0.587 * red);
            pixels[i + 2 * apart] = rounded(luma + 1.772 * blue);
        }
}

/// All frames of the file, decoded; the last one is kept.
std::vector<char> const& DicomFiles::pixels(Slice const& slice) {
    if (held_ && held_file_ == slice.file) return pixels_;
    held_ = false;
    held_frame_ = -1;
    gdcm::ImageReader reader;
    reader.SetFileName(full(slice.file).c_str());
    std::string const name = full(slice.file);
    auto const refuse = [&](std::string const& what) {
        throw Error(ErrorKind::data, text("'", name, "': damaged: ", what));
    };
    if (slice.bits == 1) { // GDCM ends the process
        gdcm::Reader bits;
        bits.SetFileName(full(slice.file).c_str());
        if (!bits.Read() || !single_bits(bits.GetFile().GetDataSet(), slice))
            refuse("its single bits cannot be read, or are encoded, which is not read");
        held_file_ = slice.file;
        held_ = true;
        return pixels_;
    }
    if (!reader.Read()) refuse("its pixels cannot be read by GDCM, or are encoded in a way that it does not know");
    gdcm::Image const& image = reader.GetImage();
    std::int64_t const frames = image.GetNumberOfDimensions() > 2 ? image.GetDimension(2) : 1;
    if (image.GetDimension(0) != slice.columns || image.GetDimension(1) != slice.rows || frames < slice.frames)
        refuse("its pixels have another extent than it says");
    auto const needed = static_cast<std::size_t>(slice.columns * slice.rows * slice.samples * frames) *
                        static_cast<std::size_t>(image.GetPixelFormat().GetPixelSize() /
                                                 std::max<unsigned>(image.GetPixelFormat().GetSamplesPerPixel(), 1));
    if (image.GetBufferLength() != needed && image.GetPixelFormat().GetBitsAllocated() != 12)
        refuse("its pixels are not as many as it says");
    pixels_.resize(image.GetBufferLength());
    if (!image.GetBuffer(pixels_.data())) refuse("its pixels cannot be decoded");
    planar_ = image.GetPlanarConfiguration() == 1;
    gdcm::PhotometricInterpretation const colours = image.GetPhotometricInterpretation();
    if (colours == gdcm::PhotometricInterpretation::YBR_FULL ||
        colours == gdcm::PhotometricInterpretation::YBR_FULL_422)
        to_colours(slice);
    auto const bytes = static_cast<std::size_t>((slice.bits + 7) / 8);
    if (pixels_.size() < static_cast<std::size_t>(slice.columns * slice.rows * slice.samples * slice.frames) * bytes)
        refuse("it ended early");
    held_file_ = slice.file;
    held_ = true;
    return pixels_;
}

void DicomFiles::to_colours(Slice const& slice) {
    if (slice.samples == 3 && slice.bits == 8)
        luma_to_rgb(pixels_, planar_ ? static_cast<std::size_t>(slice.columns * slice.rows) : 1);
}

/// A frame as it lies in the file, in this machine's byte order.
void DicomFiles::read_plain(std::istream& stream, Slice const& slice) {
    std::int64_t const size = slice.columns * slice.rows * slice.samples * slice.bits / 8, first = size * slice.frame;
    // Bytes of words of two in the other order: those of pairs are exchanged.
    bool const pairs = slice.big_endian && slice.bits == 8 && slice.words;
    std::int64_t const before = pairs ? first % 2 : 0, more = pairs ? (before + size) % 2 : 0;
    pixels_.resize(static_cast<std::size_t>(before + size + more));
    stream.seekg(slice.pixels_at + first - before);
    stream.read(pixels_.data(), std::ssize(pixels_));
    if (stream.gcount() < before + size) pixels_.clear(); // it has become shorter
    std::size_t const element = pairs ? 2 : slice.big_endian ? static_cast<std::size_t>(slice.bits / 8) : 1;
    if (element > 1) swap_bytes(reinterpret_cast<std::byte*>(pixels_.data()), pixels_.size() / element, element);
    if (!pixels_.empty()) {
        pixels_.erase(pixels_.begin(), pixels_.begin() + before);
        pixels_.resize(static_cast<std::size_t>(size));
    }
    planar_ = slice.planar && slice.samples > 1;
}

/// Runs of bytes (PackBits), which become every `step`th of those of `to`, as many as there is room for.
bool unpack_runs(std::span<unsigned char const> from, std::span<char> to, std::size_t step) {
    std::size_t in = 0, out = 0;
    while (out < to.size()) {
        if (in == from.size()) return false;
        unsigned const control = from[in++];
        if (control == 128) continue;
        bool const literal = control < 128;
        std::size_t const n = literal ? control + 1 : 257 - control;
        if (from.size() - in < (literal ? n : 1)) return false;
        for (std::size_t i = 0; i < n && out < to.size(); ++i, out += step)
            to[out] = static_cast<char>(from[in + (literal ? i : 0)]);
        in += literal ? n : 1;
    }
    return true;
}

/// A frame out of its fragment: a segment for each byte of a sample, the highest first, one sample after another
/// (PS3.5, annex G). They become planes.
bool DicomFiles::read_runs(std::istream& stream, Slice const& slice) {
    auto const number = [](unsigned char const* b) {
        return b[0] | std::uint32_t{b[1]} << 8 | std::uint32_t{b[2]} << 16 | std::uint32_t{b[3]} << 24;
    };
    std::int64_t at = slice.pixels_at;
    std::uint32_t bytes = 0;
    for (std::int64_t i = 0; i <= slice.frame + 1; ++i) { // the first item is a table of the others
        std::array<unsigned char, 8> head{};
        stream.seekg(at);
        stream.read(reinterpret_cast<char*>(head.data()), head.size());
        bytes = number(head.data() + 4);
        if (!stream || number(head.data()) != 0xe000fffe) return false; // item, in the order of its bytes
        at += 8 + (i <= slice.frame ? std::int64_t{bytes} : 0);
    }
    std::vector<unsigned char> fragment(bytes);
    stream.read(reinterpret_cast<char*>(fragment.data()), std::ssize(fragment));
    constexpr std::size_t head = 64;
    auto const width = static_cast<std::size_t>(slice.bits / 8),
               n = static_cast<std::size_t>(slice.columns * slice.rows);
    std::size_t const segments = static_cast<std::size_t>(slice.samples) * width;
    if (!stream || fragment.size() < head || segments > 15 || number(fragment.data()) != segments) return false;
    pixels_.resize(n * segments);
    for (std::size_t i = 0; i < segments; ++i) {
        std::size_t const begin = number(fragment.data() + 4 + 4 * i),
                          end = i + 1 < segments ? number(fragment.data() + 8 + 4 * i) : fragment.size();
        if (begin < head || begin > end || end > fragment.size()) return false;
        std::size_t const sample = i / width, byte = width - 1 - i % width;
        std::span<char> const plane = std::span(pixels_).subspan(sample * n * width, n * width);
        if (!unpack_runs(std::span(fragment).subspan(begin, end - begin), plane.subspan(byte), width)) return false;
    }
    planar_ = true;
    return true;
}

/// The pixels of one frame.
std::span<char const> DicomFiles::frame_of(Slice const& slice) {
    auto const bytes = static_cast<std::size_t>(slice.bits <= 8 ? 1 : slice.bits <= 16 ? 2 : 4);
    auto const size = static_cast<std::size_t>(slice.columns * slice.rows * slice.samples) * bytes;
    if (slice.pixels_at < 0) {
        std::vector<char> const& all = pixels(slice);
        if (all.size() < size * static_cast<std::size_t>(slice.frame + 1)) fail("ended early: a frame is missing");
        return std::span(all).subspan(size * static_cast<std::size_t>(slice.frame), size);
    }
    if (held_ && held_file_ == slice.file && held_frame_ == slice.frame) return pixels_;
    held_ = false;
    std::ifstream stream(full(slice.file), std::ios::binary);
    if (slice.runs && !read_runs(stream, slice))
        throw Error(ErrorKind::data, text("'", full(slice.file), "': damaged: its runs of bytes are no frame"));
    if (!slice.runs) read_plain(stream, slice);
    if (pixels_.size() != size) throw Error(ErrorKind::data, text("'", full(slice.file), "' has become shorter"));
    if (slice.photometric == "YBR_FULL") to_colours(slice);
    held_file_ = slice.file;
    held_frame_ = slice.frame;
    held_ = true;
    return pixels_;
}

template <class T>
void DicomFiles::copy_rows(Slice const& slice, char const* frame, Box const& box, std::int64_t sample,
                           std::byte* to) const {
    Index3 const size = box.dims();
    // The sign stands in the highest bit that is stored, above which anything may be.
    auto const width = static_cast<std::int64_t>(8 * sizeof(T));
    int const unused = slice.stored > 0 && slice.stored < width ? static_cast<int>(width - slice.stored) : 0;
    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
        for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
            std::int64_t const pixel = y * slice.columns + x;
            std::int64_t const at = planar_ ? sample * slice.columns * slice.rows + pixel : pixel * samples_ + sample;
            T value{};
            std::memcpy(&value, frame + static_cast<std::size_t>(at) * sizeof(T), sizeof(T));
            // Shifted out at the top and back: with the sign, or with zeros instead of what else was there (overlays).
            value = static_cast<T>(static_cast<T>(value << unused) >> unused);
            std::int64_t const place = (y - box.lower.y) * size.x + (x - box.lower.x);
            if (physical_) {
                using Real = std::conditional_t<(sizeof(T) > 2), double, float>;
                auto const real = static_cast<Real>(slice.slope * static_cast<double>(value) + slice.intercept);
                std::memcpy(to + place * static_cast<std::int64_t>(sizeof real), &real, sizeof real);
            } else {
                std::memcpy(to + static_cast<std::size_t>(place) * sizeof(T), &value, sizeof(T));
            }
        }
}

void DicomFiles::read(std::int64_t volume, Box const& box, std::byte* to) {
    Index3 const size = box.dims();
    std::int64_t const sample = volume % samples_;
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z) {
        Slice const& slice = slices_[static_cast<std::size_t>(volume / samples_ * dims_.z + z)];
        auto const bytes = static_cast<std::size_t>(slice.bits <= 8 ? 1 : slice.bits <= 16 ? 2 : 4);
        char const* const frame = frame_of(slice).data();
        std::byte* const there =
            to + static_cast<std::size_t>((z - box.lower.z) * size.x * size.y) * (!physical_  ? bytes
                                                                                  : bytes > 2 ? 8
                                                                                              : 4);
        if (bytes == 1)
            slice.is_signed ? copy_rows<std::int8_t>(slice, frame, box, sample, there)
                            : copy_rows<std::uint8_t>(slice, frame, box, sample, there);
        else if (bytes == 2)
            slice.is_signed ? copy_rows<std::int16_t>(slice, frame, box, sample, there)
                            : copy_rows<std::uint16_t>(slice, frame, box, sample, there);
        else
            slice.is_signed ? copy_rows<std::int32_t>(slice, frame, box, sample, there)
                            : copy_rows<std::uint32_t>(slice, frame, box, sample, there);
    }
}

} // namespace

std::unique_ptr<GridsParser> open(std::string const& path) { return std::make_unique<DicomFiles>(path); }

} // namespace vkt::dicom

namespace vkt {
namespace {
DicomFunctions const functions{dicom::writer};
ParserHandler parse(std::string const& path) {
    return answer_about_grids([path] { return dicom::open(path); });
}
} // namespace
} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_gdcm;
vkt::ModuleExport const vkt_module_gdcm{VKT_VERSION, &vkt::functions, &vkt::parse};
}
