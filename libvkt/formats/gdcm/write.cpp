// Writing DICOM: what stands before the voxels by GDCM, the voxels behind it as they come.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/dicom.h"
#include "libvkt/formats/dicom_module.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/io/output_directory.h"
#include "libvkt/io/output_file.h"

#include <gdcmFile.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmTag.h>
#include <gdcmTrace.h>
#include <gdcmWriter.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <sstream>

namespace vkt::dicom {
namespace {

namespace fs = std::filesystem;
using gdcm::VR;

constexpr std::size_t longest_decimal = 16;      ///< characters of a number in text (PS3.5, 6.2)
constexpr std::size_t longest_word = 64;         ///< of a Long String
constexpr std::size_t longest_code = 16;         ///< of a Code String
constexpr std::uint64_t most_bytes = 0xfffffffe; ///< of pixel data that say their length
constexpr std::int64_t most_pixels = 65535;      ///< along a side
/// What rounding may have left of right angles.
constexpr double angle_tolerance = 1e-5;

/// With as many digits as there is room for.
std::string decimal(double value) {
    std::string words = to_text(value + 0.0); // no negative zero
    for (int digits = 16; words.size() > longest_decimal; --digits) {
        std::array<char, 40> shorter{};
        std::snprintf(shorter.data(), shorter.size(), "%.*g", digits, value);
        words = shorter.data();
    }
    return words;
}

std::string decimals(std::initializer_list<double> values) {
    std::vector<std::string> words;
    for (double const value : values) words.push_back(decimal(value));
    return join(words, "\\");
}

/// 2.25 and 128 random bits as one number: a UID that nobody has to be asked for (PS3.5, B.2).
std::string new_uid() {
    std::random_device random;
    std::array<std::uint32_t, 4> words{random(), random(), random(), random()};
    words[1] = (words[1] & 0xffff0fffU) | 0x4000U; // of version 4, variant 2
    words[2] = (words[2] & 0x3fffffffU) | 0x80000000U;
    std::string digits;
    while (std::any_of(words.begin(), words.end(), [](std::uint32_t w) { return w != 0; })) {
        std::uint64_t rest = 0;
        for (std::uint32_t& word : words) {
            std::uint64_t const value = rest << 32 | word;
            word = static_cast<std::uint32_t>(value / 10);
            rest = value % 10;
        }
        digits.insert(digits.begin(), static_cast<char>('0' + rest));
    }
    return "2.25." + digits;
}

void put(gdcm::DataSet& set, std::uint16_t group, std::uint16_t element, VR::VRType vr, std::string words) {
    if (words.size() % 2 != 0) words += vr == VR::UI ? '\0' : ' ';
    gdcm::DataElement data(gdcm::Tag(group, element));
    data.SetVR(vr);
    data.SetByteValue(words.data(), static_cast<std::uint32_t>(words.size()));
    set.Replace(data);
}

void put(gdcm::DataSet& set, std::uint16_t group, std::uint16_t element, std::int64_t number) {
    std::string bytes(2, '\0'); // GDCM has numbers in the file's order, which is little-endian
    bytes[0] = static_cast<char>(number & 255);
    bytes[1] = static_cast<char>(number >> 8 & 255);
    put(set, group, element, VR::US, bytes);
}

void put(gdcm::DataSet& set, std::uint16_t group, std::uint16_t element, std::vector<gdcm::DataSet> const& items) {
    gdcm::SmartPointer<gdcm::SequenceOfItems> const sequence = new gdcm::SequenceOfItems;
    sequence->SetLengthToUndefined();
    for (gdcm::DataSet const& own : items) {
        gdcm::Item item;
        item.SetVLToUndefined();
        item.SetNestedDataSet(own);
        sequence->AddItem(item);
    }
    gdcm::DataElement data(gdcm::Tag(group, element));
    data.SetVR(VR::SQ);
    data.SetValue(*sequence);
    data.SetVLToUndefined();
    set.Replace(data);
}

/// Millimetres of a unit of lengths, if it is the same along all axes and known.
std::optional<double> millimetres(std::string const& units) {
    auto const entries = quoted_entries(units);
    if (!entries || entries->size() != 3 || std::count(entries->begin(), entries->end(), entries->front()) != 3)
        return std::nullopt;
    for (auto const& [name, factor] : {std::pair{"\"mm\"", 1.0},
                                       {"\"um\"", 1e-3},
                                       {"\"nm\"", 1e-6},
                                       {"\"angstrom\"", 1e-7},
                                       {"\"cm\"", 10.0},
                                       {"\"m\"", 1e3}})
        if (entries->front() == name) return factor;
    return std::nullopt;
}

bool is_code(std::string const& word) {
    return !word.empty() && word.size() <= longest_code && std::all_of(word.begin(), word.end(), [](char c) {
        return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    });
}

bool is_word(std::string const& word) {
    return word.size() <= longest_word && printable(word) == word && word.find('\\') == std::string::npos &&
           trimmed(word) == word;
}

/// True of a folder of DICOM files and nothing else, which may be replaced by another.
bool only_dicom(std::string const& folder) {
    std::error_code error;
    for (auto const& entry : fs::directory_iterator(folder, error)) {
        std::array<char, dicom_head_bytes> head{};
        std::ifstream file(entry.path(), std::ios::binary);
        file.read(head.data(), head.size());
        auto const got = static_cast<std::size_t>(file.gcount());
        if (!entry.is_regular_file(error) || !begins_as_dicom(std::as_bytes(std::span(head.data(), got)))) return false;
    }
    return !error;
}

class DicomWriter : public VolumeWriter {
public:
    DicomWriter(std::string const& path, WriteOptions const& options) : options_(options) {
        gdcm::Trace::DebugOff();
        gdcm::Trace::WarningOff();
        gdcm::Trace::ErrorOff();
        if (options.compress)
            throw Error(ErrorKind::usage, "DICOM files are not compressed by vkt", "leave out --compress");
        if (options.one_file || lower_case(path).ends_with(".dcm") || path == "-")
            file_.emplace(path, options.force);
        else
            folder_.emplace(path, options.force, only_dicom, "DICOM files");
    }

    void begin(Header const& header) override;
    void write(std::byte const* voxels, std::size_t n) override;
    void close() override;

private:
    void take_lattice(Header const& header);
    void take_words(Header const& header);
    gdcm::DataSet common() const;
    void put_values(gdcm::DataSet& set) const;
    void put_measures(gdcm::DataSet& set) const;
    void put_orientation(gdcm::DataSet& set) const;
    void put_position(gdcm::DataSet& set, std::int64_t slice) const;
    void put_frames(gdcm::DataSet& set) const;
    void put_head(OutputFile& file, std::int64_t slice, std::size_t bytes);
    void put_voxels(OutputFile& file, std::byte const* voxels, std::size_t n);

    WriteOptions options_;
    std::optional<OutputFile> file_, slice_file_;
    std::optional<OutputDirectory> folder_;
    bool begun_ = false;
    Index3 dims_;
    DataType dtype_ = DataType::uint8;
    Geometry geometry_; ///< in millimetres, in DICOM's frame
    std::string slope_, intercept_, units_, modality_ = "OT";
    bool dark_ = false; ///< the largest value is black
    std::string const study_ = new_uid(), series_ = new_uid(), frame_ = new_uid();
    std::size_t slice_bytes_ = 0, in_slice_ = 0;
    std::int64_t slice_ = 0;
};

/// Takes the place in the world, or throws Error{usage} for what DICOM has no place for.
void DicomWriter::take_lattice(Header const& header) {
    geometry_ = geometry_in(lps_frame, header);
    auto const& d = geometry_.direction;
    double const right = std::abs(dot(d[0], d[1])), along = std::abs(dot(cross(d[0], d[1]), d[2]));
    if (right > angle_tolerance || along < 1 - angle_tolerance * angle_tolerance)
        throw Error(ErrorKind::usage, "DICOM has no sheared lattices, and the axes of this one are not at right angles",
                    "put it on a straight one first: vkt resample --like FILE");
    auto const found = header.attributes.find("space units");
    double const factor = found == header.attributes.end() ? 1 : millimetres(found->second).value_or(1);
    if (factor != 1) geometry_.spacing = geometry_.spacing * factor, geometry_.origin = geometry_.origin * factor;
}

/// Takes what is said of the values, and tells what is lost of the header.
void DicomWriter::take_words(Header const& header) {
    Header lost = header;
    auto& attributes = lost.attributes;
    if (is_anatomical(frame_of(header))) attributes.erase("space");
    if (auto const found = attributes.find("space units");
        found != attributes.end() && millimetres(found->second).has_value())
        attributes.erase(found);
    if (auto const found = attributes.find("modality"); found != attributes.end() && is_code(found->second)) {
        modality_ = found->second;
        attributes.erase(found);
    }
    if (auto const found = attributes.find("photometric");
        found != attributes.end() && found->second == "min is white") {
        dark_ = true;
        attributes.erase(found);
    }
    slope_ = decimal(header.values.slope);
    intercept_ = decimal(header.values.intercept);
    lost.values = {};
    units_ = header.units.empty() || !is_word(header.units) ? "US" : header.units; // unspecified
    if (units_ == header.units) lost.units.clear();
    Kept kept = nothing_kept;
    kept.spacing = kept.directions = true;
    if (number_in(slope_) != header.values.slope || number_in(intercept_) != header.values.intercept)
        kept.besides.emplace_back("all digits of the map of values");
    tell_losses(options_, lost, "DICOM files", kept);
}

void DicomWriter::begin(Header const& header) {
    refuse_bricks_and_series(header, begun_, "DICOM files", folder_ ? "a DICOM folder" : "a DICOM file",
                             folder_ ? "/" : ".dcm");
    if (!is_integer(header.dtype) || size_of(header.dtype) > 2)
        throw Error(ErrorKind::usage, text("DICOM images hold 8 or 16 bits in a pixel, not ", header.dtype),
                    "convert first, values in 65536 steps: vkt convert --dtype uint16 --range minmax");
    if (header.dims.x > most_pixels || header.dims.y > most_pixels)
        throw Error(ErrorKind::usage, text("slices of ", header.dims.x, " by ", header.dims.y,
                                           " are larger than those of DICOM, which has up to 65535 by 65535"));
    dims_ = header.dims;
    dtype_ = header.dtype;
    slice_bytes_ = static_cast<std::size_t>(dims_.x * dims_.y) * size_of(dtype_);
    if (static_cast<std::uint64_t>(folder_ ? slice_bytes_ : header.bytes()) > most_bytes)
        throw Error(ErrorKind::usage,
                    text("a DICOM file holds less than 4 GiB of pixels, not ",
                         bytes_text(static_cast<double>(folder_ ? slice_bytes_ : header.bytes()))),
                    folder_ ? "" : "write a folder with a file for each slice: -o NAME/");
    Header const told = in_utf8(header);
    take_lattice(told);
    take_words(told);
    if (!file_) return;
    file_->expect(header.bytes());
    put_head(*file_, 0, header.bytes());
}

/// Of every file, whoever's it is: nothing about anybody.
gdcm::DataSet DicomWriter::common() const {
    gdcm::DataSet set;
    bool const several = file_.has_value();
    put(set, 0x0008, 0x0005, VR::CS, "ISO_IR 192");
    put(set, 0x0008, 0x0008, VR::CS, "DERIVED\\SECONDARY");
    // Secondary Capture: an image of a slice, multi-frame ones of bytes and of words.
    put(set, 0x0008, 0x0016, VR::UI,
        text("1.2.840.10008.5.1.4.1.1.7", !several               ? ""
                                          : size_of(dtype_) == 1 ? ".2"
                                                                 : ".3"));
    put(set, 0x0008, 0x0018, VR::UI, new_uid());
    put(set, 0x0008, 0x0060, VR::CS, modality_);
    put(set, 0x0008, 0x0064, VR::CS, "WSD");
    put(set, 0x0020, 0x000d, VR::UI, study_);
    put(set, 0x0020, 0x000e, VR::UI, series_);
    put(set, 0x0020, 0x0052, VR::UI, frame_);
    put(set, 0x0020, 0x0011, VR::IS, "1");
    // What must be there, and may be empty.
    struct Element {
        std::uint16_t group, element;
        VR::VRType vr;
    };
    for (auto const& [group, element, vr] : {Element{0x0008, 0x0020, VR::DA},
                                             {0x0008, 0x0030, VR::TM},
                                             {0x0008, 0x0050, VR::SH},
                                             {0x0008, 0x0070, VR::LO},
                                             {0x0008, 0x0090, VR::PN},
                                             {0x0010, 0x0010, VR::PN},
                                             {0x0010, 0x0020, VR::LO},
                                             {0x0010, 0x0030, VR::DA},
                                             {0x0010, 0x0040, VR::CS},
                                             {0x0020, 0x0010, VR::SH},
                                             {0x0020, 0x1040, VR::LO}})
        put(set, group, element, vr, "");
    std::int64_t const bits = static_cast<std::int64_t>(8 * size_of(dtype_));
    put(set, 0x0028, 0x0002, 1);
    put(set, 0x0028, 0x0004, VR::CS, dark_ ? "MONOCHROME1" : "MONOCHROME2");
    put(set, 0x0028, 0x0010, dims_.y);
    put(set, 0x0028, 0x0011, dims_.x);
    put(set, 0x0028, 0x0100, bits);
    put(set, 0x0028, 0x0101, bits);
    put(set, 0x0028, 0x0102, bits - 1);
    put(set, 0x0028, 0x0103, is_signed(dtype_) ? 1 : 0);
    put_values(set);
    put(set, 0x2050, 0x0020, VR::CS, dark_ ? "INVERSE" : "IDENTITY");
    return set;
}

void DicomWriter::put_values(gdcm::DataSet& set) const {
    put(set, 0x0028, 0x1052, VR::DS, intercept_);
    put(set, 0x0028, 0x1053, VR::DS, slope_);
    put(set, 0x0028, 0x1054, VR::LO, units_);
}

void DicomWriter::put_measures(gdcm::DataSet& set) const {
    put(set, 0x0028, 0x0030, VR::DS, decimals({geometry_.spacing.y, geometry_.spacing.x}));
    put(set, 0x0018, 0x0050, VR::DS, decimal(geometry_.spacing.z));
    put(set, 0x0018, 0x0088, VR::DS, decimal(geometry_.spacing.z));
}

void DicomWriter::put_orientation(gdcm::DataSet& set) const {
    Vec3 const a = geometry_.direction[0], b = geometry_.direction[1];
    put(set, 0x0020, 0x0037, VR::DS, decimals({a.x, a.y, a.z, b.x, b.y, b.z}));
}

void DicomWriter::put_position(gdcm::DataSet& set, std::int64_t slice) const {
    Vec3 const at = geometry_.origin + geometry_.direction[2] * (static_cast<double>(slice) * geometry_.spacing.z);
    put(set, 0x0020, 0x0032, VR::DS, decimals({at.x, at.y, at.z}));
}

/// Frames of one file have their places in functional groups.
void DicomWriter::put_frames(gdcm::DataSet& set) const {
    put(set, 0x0020, 0x0013, VR::IS, "1");
    put(set, 0x0028, 0x0008, VR::IS, to_text(dims_.z));
    put(set, 0x0028, 0x0009, VR::AT, std::string("\0\x52\x30\x92", 4)); // frames go on as the groups of each do
    gdcm::DataSet shared, orientation, measures, values;
    put_orientation(orientation);
    put_measures(measures);
    put_values(values);
    put(shared, 0x0020, 0x9116, {orientation});
    put(shared, 0x0028, 0x9110, {measures});
    put(shared, 0x0028, 0x9145, {values});
    put(set, 0x5200, 0x9229, {shared});
    std::vector<gdcm::DataSet> frames;
    for (std::int64_t z = 0; z < dims_.z; ++z) {
        gdcm::DataSet position, frame;
        put_position(position, z);
        put(frame, 0x0020, 0x9113, {position});
        frames.push_back(frame);
    }
    put(set, 0x5200, 0x9230, frames);
}

/// All that stands before the voxels, `bytes` of which follow.
void DicomWriter::put_head(OutputFile& file, std::int64_t slice, std::size_t bytes) {
    gdcm::Writer writer;
    gdcm::DataSet set = common();
    if (file_) {
        put_frames(set);
    } else {
        put(set, 0x0020, 0x0013, VR::IS, to_text(slice + 1));
        put_orientation(set);
        put_measures(set);
        put_position(set, slice);
    }
    writer.GetFile().GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
    writer.GetFile().SetDataSet(set);
    std::ostringstream stream;
    writer.SetStream(stream);
    if (!writer.Write()) throw Error(ErrorKind::failure, text("GDCM cannot write the header of '", file.path(), "'"));
    std::string head = stream.str();
    head.append("\xe0\x7f\x10\0", 4).append(size_of(dtype_) == 1 ? "OB" : "OW").append(2, '\0');
    std::size_t const even = bytes + bytes % 2;
    for (std::size_t i = 0; i < 4; ++i) head += static_cast<char>(even >> (8 * i) & 255);
    file.write(head.data(), head.size());
}

void DicomWriter::put_voxels(OutputFile& file, std::byte const* voxels, std::size_t n) {
    if (size_of(dtype_) == 1 || std::endian::native == std::endian::little) return file.write(voxels, n);
    std::vector<std::byte> swapped(voxels, voxels + n);
    swap_bytes(swapped.data(), n / 2, 2);
    file.write(swapped.data(), n);
}

void DicomWriter::write(std::byte const* voxels, std::size_t n) {
    if (file_) return put_voxels(*file_, voxels, n);
    while (n > 0) {
        if (!slice_file_) {
            std::string number = to_text(slice_ + 1);
            number.insert(0, std::max<std::size_t>(to_text(dims_.z).size(), 4) - number.size(), '0');
            slice_file_.emplace(folder_->file(text("slice", number, ".dcm")), false);
            slice_file_->expect(slice_bytes_ * static_cast<std::size_t>(dims_.z - slice_));
            put_head(*slice_file_, slice_, slice_bytes_);
        }
        std::size_t const count = std::min(n, slice_bytes_ - in_slice_);
        put_voxels(*slice_file_, voxels, count);
        voxels += count;
        n -= count;
        in_slice_ += count;
        if (in_slice_ < slice_bytes_) return;
        if (slice_bytes_ % 2 != 0) slice_file_->write("", 1);
        slice_file_->commit();
        slice_file_.reset();
        in_slice_ = 0;
        ++slice_;
    }
}

void DicomWriter::close() {
    if (!begun_) throw Error(ErrorKind::data, "there is no volume to write");
    if (folder_) return folder_->commit();
    if (slice_bytes_ * static_cast<std::size_t>(dims_.z) % 2 != 0) file_->write("", 1);
    file_->commit();
}

} // namespace

std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options) {
    return std::make_unique<DicomWriter>(path, options);
}

} // namespace vkt::dicom
