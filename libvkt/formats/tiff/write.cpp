// Writing TIFF with libtiff, as ImageJ does: a page a slice, the stack described in the first page; channels as OME.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/series_axes.h"
#include "libvkt/formats/tiff/complaint.h"
#include "libvkt/formats/tiff_module.h"

#include <tiffio.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

namespace vkt::tiff {
namespace {

constexpr std::size_t classic_limit = std::size_t{2} << 30;
constexpr std::size_t compressed_strip = std::size_t{256} << 10;
/// Readers that look for slices in one piece find them up to here; libtiff holds a strip in memory.
constexpr std::size_t largest_strip = std::size_t{64} << 20;
constexpr std::size_t most_history = std::size_t{256} << 10;

/// Empty for types that OME does not know.
std::string ome_type(DataType type) {
    if (type == DataType::float32) return "float";
    if (type == DataType::float64) return "double";
    return is_integer(type) && size_of(type) <= 4 ? std::string(name_of(type)) : "";
}

/// The unit in an attribute that names one, or the same for so many axes; else empty.
std::string unit_of(Header const& header, char const* attribute, std::size_t axes) {
    auto const found = header.attributes.find(attribute);
    auto const units = found == header.attributes.end() ? std::nullopt : quoted_entries(found->second);
    if (!units || units->size() != axes || units->front().size() <= 2) return "";
    if (std::any_of(units->begin(), units->end(), [&](std::string const& unit) { return unit != units->front(); }))
        return "";
    return units->front().substr(1, units->front().size() - 2);
}

std::string ome_unit(std::string const& unit) {
    constexpr std::pair<char const*, char const*> names[] = {
        {"um", "\xC2\xB5m"},      {"nm", "nm"},  {"mm", "mm"}, {"cm", "cm"}, {"m", "m"},
        {"angstrom", "\xC3\x85"}, {"inch", "in"}};
    for (auto const& [own, name] : names)
        if (unit == own) return name;
    return "pixel";
}

/// Between two times, if they are even and in a unit that is known, or in none.
std::optional<double> seconds_of(SeriesAxis const& times, Header const& header) {
    auto const steps = steps_of(times, header);
    bool const said = !times.places.front().empty() || header.attributes.contains("sequence step");
    if (!steps || !said) return std::nullopt;
    constexpr std::pair<char const*, double> units[] = {{"", 1}, {"s", 1}, {"ms", 1000}, {"us", 1e6}};
    constexpr std::pair<char const*, double> longer[] = {{"min", 60}, {"h", 3600}, {"d", 86400}};
    std::string const unit = unit_of(header, "sequence units", 1);
    for (auto const& [name, of_a_second] : units)
        if (unit == name) return steps->step / of_a_second;
    for (auto const& [name, seconds] : longer)
        if (unit == name) return steps->step * seconds;
    return std::nullopt;
}

std::string in_xml(std::string const& words) {
    std::string result;
    for (char const c : words)
        result += c == '&'                               ? "&amp;"
                  : c == '<'                             ? "&lt;"
                  : c == '>'                             ? "&gt;"
                  : c == '"'                             ? "&quot;"
                  : static_cast<unsigned char>(c) < 0x20 ? " "
                                                         : std::string(1, c);
    return result;
}

class TiffWriter : public VolumeWriter {
public:
    TiffWriter(std::string const& path, WriteOptions const& options) : file_(path, options.force), options_(options) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': TIFF files cannot be written to a pipe"),
                        "name a file: -o out.tif");
    }
    ~TiffWriter() override {
        if (tiff_ != nullptr) TIFFClose(tiff_);
    }
    TiffWriter(TiffWriter const&) = delete;
    TiffWriter& operator=(TiffWriter const&) = delete;

    void begin(Header const& header) override;
    void write(std::byte const* voxels, std::size_t n) override;
    void close() override;

private:
    [[noreturn]] void fail() const {
        bool const full = complaint().find("Maximum TIFF file size") != std::string::npos;
        throw Error(full ? ErrorKind::usage : ErrorKind::io, text("cannot write '", file_.path(), "': ", complaint()),
                    full ? "write one file for each volume: name it like out_%04d.tif" : "");
    }
    void need(bool done) const {
        if (!done) fail();
    }
    void open();
    void begin_page();
    void flush_strip();
    std::string description() const;
    std::string imagej() const;
    std::string ome(SeriesAxis const& channels) const;
    std::string ours() const;
    SeriesAxis const* axis(bool time) const;

    OutputFile file_;
    WriteOptions options_;
    TIFF* tiff_ = nullptr;
    SeriesAxes series_{"TIFF file", ".tif"};
    std::vector<SeriesAxis> axes_;
    Header first_; ///< with what all volumes have in common
    std::int64_t page_ = 0;
    std::size_t row_ = 0; ///< bytes
    std::uint32_t rows_per_strip_ = 1, rows_done_ = 0, strip_ = 0;
    bool in_page_ = false;
    std::vector<std::byte> held_; ///< rows of the strip that is not full yet
};

void TiffWriter::begin(Header const& header) {
    refuse_bricks(header, "TIFF");
    if (header.dims.x > std::numeric_limits<std::int32_t>::max() ||
        header.dims.y > std::numeric_limits<std::int32_t>::max())
        throw Error(ErrorKind::usage,
                    text("a page of ", header.dims.x, " by ", header.dims.y, " pixels is too large for TIFF"));
    series_.add(header);
    if (series_.has_channels() && ome_type(header.dtype).empty())
        throw Error(ErrorKind::usage, text("channels of TIFF are OME's, which knows no ", header.dtype),
                    "convert first: vkt convert --dtype float32");
    file_.expect(options_.compress ? header.bytes() / 1032 : header.bytes());
    if (series_.volumes() > 1) return;
    first_ = series_.header();
    row_ = static_cast<std::size_t>(header.dims.x) * size_of(header.dtype);
    std::size_t const strip = options_.compress ? compressed_strip : largest_strip;
    rows_per_strip_ =
        static_cast<std::uint32_t>(std::clamp<std::size_t>(strip / row_, 1, static_cast<std::size_t>(header.dims.y)));
    open();
}

void TiffWriter::open() {
    TIFFSetErrorHandler(complain);
    TIFFSetWarningHandler(nullptr);
    int const copy = ::fcntl(file_.descriptor(), F_DUPFD_CLOEXEC, 3);
    if (copy >= 0) tiff_ = TIFFFdOpen(copy, file_.path().c_str(), first_.bytes() >= classic_limit ? "w8" : "w");
    if (tiff_ != nullptr) return;
    if (copy >= 0) ::close(copy);
    fail();
}

SeriesAxis const* TiffWriter::axis(bool time) const {
    auto const found = std::find_if(axes_.begin(), axes_.end(), [&](SeriesAxis const& a) { return a.time == time; });
    return found == axes_.end() ? nullptr : &*found;
}

std::string TiffWriter::description() const {
    SeriesAxis const* const channels = axis(false);
    return channels != nullptr ? ome(*channels) : imagej();
}

/// The header, for vkt. Of times the first is there, from which others are counted.
std::string TiffWriter::ours() const {
    Header kept = first_;
    kept.timing = kept.dry_run = false;
    if (kept.history) kept.history = parse_history(history_text(*kept.history, most_history));
    if (SeriesAxis const* const times = axis(true); times != nullptr && !times->places.front().empty()) {
        if (auto const steps = steps_of(*times, first_)) {
            kept.attributes["sequence position"] = times->places.front();
            kept.attributes["sequence step"] = to_text(steps->step);
        } else {
            kept.attributes[uneven_times] = join(times->places, " ");
        }
    }
    return one_line(to_json(kept));
}

/// What ImageJ writes, and a line for vkt.
std::string TiffWriter::imagej() const {
    std::int64_t const volumes = series_.volumes();
    std::string result = text("ImageJ=1.53t\nimages=", first_.dims.z * volumes, "\n");
    if (first_.dims.z > 1 || volumes > 1) result += text("slices=", first_.dims.z, "\n");
    if (volumes > 1) result += text("frames=", volumes, "\nhyperstack=true\n");
    if (std::string const unit = unit_of(first_, "space units", 3); !unit.empty()) result += text("unit=", unit, "\n");
    result += text("spacing=", first_.geometry.spacing.z, "\nloop=false\n");
    SeriesAxis const* const times = axis(true);
    if (auto const step = times != nullptr ? seconds_of(*times, first_) : std::nullopt)
        result += text("finterval=", *step, "\n");
    if (first_.values != ValueMap{})
        result += text("cf=0\nc0=", first_.values.intercept, "\nc1=", first_.values.slope,
                       "\nvunit=", first_.units.empty() ? "Gray Value" : one_line(first_.units), "\n");
    return result + tiff_header_line + ours() + "\n";
}

/// OME's document, since pages of ImageJ have channels fastest, and volumes come with their slices so.
std::string TiffWriter::ome(SeriesAxis const& channels) const {
    SeriesAxis const* const times = axis(true);
    std::string const type = ome_type(first_.dtype);
    std::string result =
        text("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
             "<OME xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\" "
             "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
             "xsi:schemaLocation=\"http://www.openmicroscopy.org/Schemas/OME/2016-06 "
             "http://www.openmicroscopy.org/Schemas/OME/2016-06/ome.xsd\">\n"
             "<Image ID=\"Image:0\">\n<Pixels ID=\"Pixels:0\" DimensionOrder=\"",
             axes_.front().time || times == nullptr ? "XYZCT" : "XYZTC", "\" Type=\"", type, "\" SizeX=\"",
             first_.dims.x, "\" SizeY=\"", first_.dims.y, "\" SizeZ=\"", first_.dims.z, "\" SizeC=\"", channels.size(),
             "\" SizeT=\"", times == nullptr ? 1 : times->size(), "\"");
    std::string const unit = ome_unit(unit_of(first_, "space units", 3));
    for (int a = 0; a < 3; ++a) {
        std::string const key = text(" PhysicalSize", std::string(1, "XYZ"[a]));
        result += text(key, "=\"", first_.geometry.spacing[a], "\"", key, "Unit=\"", unit, "\"");
    }
    if (auto const step = times != nullptr ? seconds_of(*times, first_) : std::nullopt)
        result += text(" TimeIncrement=\"", *step, "\" TimeIncrementUnit=\"s\"");
    result += ">\n";
    std::vector<std::string> const names = channels_of(channels);
    for (std::size_t i = 0; i < names.size(); ++i)
        result += text("<Channel ID=\"Channel:0:", static_cast<std::int64_t>(i), "\" Name=\"", in_xml(names[i]),
                       "\" SamplesPerPixel=\"1\"/>\n");
    return text(result, "<TiffData IFD=\"0\" PlaneCount=\"", first_.dims.z * series_.volumes(),
                "\"/>\n</Pixels>\n</Image>\n<StructuredAnnotations>\n<CommentAnnotation ID=\"Annotation:0\" "
                "Namespace=\"",
                tiff_header_namespace, "\"><Value>", in_xml(ours()),
                "</Value></CommentAnnotation>\n</StructuredAnnotations>\n</OME>");
}

void TiffWriter::begin_page() {
    auto const set = [&](std::uint32_t tag, auto... values) { need(TIFFSetField(tiff_, tag, values...) != 0); };
    bool const real = !is_integer(first_.dtype);
    set(TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(first_.dims.x));
    set(TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(first_.dims.y));
    set(TIFFTAG_BITSPERSAMPLE, static_cast<int>(8 * size_of(first_.dtype)));
    set(TIFFTAG_SAMPLESPERPIXEL, 1);
    set(TIFFTAG_SAMPLEFORMAT, real                      ? SAMPLEFORMAT_IEEEFP
                              : is_signed(first_.dtype) ? SAMPLEFORMAT_INT
                                                        : SAMPLEFORMAT_UINT);
    set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    set(TIFFTAG_ROWSPERSTRIP, rows_per_strip_);
    set(TIFFTAG_COMPRESSION, options_.compress ? COMPRESSION_ADOBE_DEFLATE : COMPRESSION_NONE);
    // libtiff has no predictor for half floats, nor for integers of 8 bytes before 4.3.
    if (options_.compress && first_.dtype != DataType::float16 && (real || size_of(first_.dtype) < 8))
        set(TIFFTAG_PREDICTOR, real ? PREDICTOR_FLOATINGPOINT : PREDICTOR_HORIZONTAL);
    set(TIFFTAG_RESOLUTIONUNIT, RESUNIT_NONE);
    set(TIFFTAG_XRESOLUTION, 1 / first_.geometry.spacing.x);
    set(TIFFTAG_YRESOLUTION, 1 / first_.geometry.spacing.y);
    if (page_ == 0) set(TIFFTAG_IMAGEDESCRIPTION, description().c_str());
    // ImageJ's own files have one directory and all voxels behind it, and tifffile takes ours for one of them if the
    // voxels of all pages would have room before the second directory: a long description must not lie between them.
    if (page_ == 0 && !options_.compress && rows_per_strip_ == static_cast<std::uint32_t>(first_.dims.y))
        need(TIFFCheckpointDirectory(tiff_) != 0);
    in_page_ = true;
    rows_done_ = strip_ = 0;
    held_.clear();
}

void TiffWriter::flush_strip() {
    complaint().clear();
    need(TIFFWriteEncodedStrip(tiff_, strip_++, held_.data(), static_cast<tmsize_t>(held_.size())) >= 0);
    held_.clear();
}

void TiffWriter::write(std::byte const* voxels, std::size_t n) {
    auto const height = static_cast<std::uint32_t>(first_.dims.y);
    while (n > 0) {
        if (!in_page_) begin_page();
        std::uint32_t const end = std::min(height, (strip_ + 1) * rows_per_strip_);
        std::size_t const wanted = (end - rows_done_) * row_, take = std::min(wanted, n);
        held_.insert(held_.end(), voxels, voxels + take);
        voxels += take;
        n -= take;
        rows_done_ += static_cast<std::uint32_t>(take / row_);
        if (take < wanted) return;
        flush_strip();
        if (rows_done_ < height) continue;
        complaint().clear();
        need(TIFFWriteDirectory(tiff_) != 0);
        in_page_ = false;
        ++page_;
    }
}

void TiffWriter::close() {
    std::int64_t const volumes = series_.volumes();
    if (volumes == 0) throw Error(ErrorKind::data, "there is no volume to write");
    series_.finish();
    axes_ = series_.axes();
    first_ = series_.header();
    tell_private_values(options_, first_, "TIFF", "ImageJ");
    if (!series_.differing().empty() && options_.notice)
        options_.notice(text("one TIFF file does not hold attributes that differ between its volumes (",
                             join(series_.differing(), ", "), "): not kept"));
    complaint().clear();
    if (volumes > 1) { // their number stands in the first page
        need(TIFFSetDirectory(tiff_, 0) != 0);
        need(TIFFSetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, description().c_str()) != 0);
        need(TIFFRewriteDirectory(tiff_) != 0);
    }
    need(TIFFFlush(tiff_) != 0);
    TIFFClose(std::exchange(tiff_, nullptr));
    if (!complaint().empty()) fail();
    file_.commit();
}

} // namespace

std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options) {
    return std::make_unique<TiffWriter>(path, options);
}

} // namespace vkt::tiff
