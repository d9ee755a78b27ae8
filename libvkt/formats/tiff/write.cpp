// Writing TIFF with libtiff, as ImageJ does: a page a slice, the stack described in the first page.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/tiff_module.h"

#include <tiffio.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <optional>

#include <fcntl.h>
#include <unistd.h>

namespace vkt::tiff {
namespace {

constexpr std::size_t classic_limit = std::size_t{2} << 30;
constexpr std::size_t compressed_strip = std::size_t{256} << 10;
/// Readers that look for slices in one piece find them up to here; libtiff holds a strip in memory.
constexpr std::size_t largest_strip = std::size_t{64} << 20;
constexpr std::size_t most_history = std::size_t{256} << 10;

thread_local std::string complaint;

void complain(char const* module, char const* format, va_list arguments) {
    char line[300];
    std::vsnprintf(line, sizeof line, format, arguments);
    complaint = text(module != nullptr ? text(module, ": ") : "", line);
}

class TiffWriter : public VolumeWriter {
public:
    TiffWriter(std::string const& path, WriteOptions const& options)
        : file_(path, options.force), compress_(options.compress) {
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
        bool const full = complaint.find("Maximum TIFF file size") != std::string::npos;
        throw Error(full ? ErrorKind::usage : ErrorKind::io, text("cannot write '", file_.path(), "': ", complaint),
                    full ? "write one file for each volume: name it like out_%04d.tif" : "");
    }
    void need(bool done) const {
        if (!done) fail();
    }
    void open();
    void begin_page();
    void flush_strip();
    std::string description() const;

    OutputFile file_;
    bool compress_;
    TIFF* tiff_ = nullptr;
    Header first_;
    std::int64_t volumes_ = 0, page_ = 0;
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
    if (volumes_ > 0 && !same_lattice(first_, header))
        throw Error(ErrorKind::usage, "one TIFF file cannot hold volumes of different dims, types or geometry",
                    "write one file each: name it like out_%04d.tif");
    file_.expect(compress_ ? header.bytes() / 1032 : header.bytes());
    if (volumes_++ > 0) return;
    first_ = in_utf8(header);
    row_ = static_cast<std::size_t>(header.dims.x) * size_of(header.dtype);
    std::size_t const strip = compress_ ? compressed_strip : largest_strip;
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

/// What ImageJ writes, and a line for vkt.
std::string TiffWriter::description() const {
    std::string result = text("ImageJ=1.53t\nimages=", first_.dims.z * volumes_, "\n");
    if (first_.dims.z > 1 || volumes_ > 1) result += text("slices=", first_.dims.z, "\n");
    if (volumes_ > 1) result += text("frames=", volumes_, "\nhyperstack=true\n");
    auto const attribute = [&](char const* key) {
        auto const found = first_.attributes.find(key);
        return found == first_.attributes.end() ? std::string() : found->second;
    };
    auto const units = quoted_entries(attribute("space units"));
    if (units && units->size() == 3 && (*units)[0] == (*units)[1] && (*units)[0] == (*units)[2] &&
        (*units)[0].size() > 2)
        result += text("unit=", (*units)[0].substr(1, (*units)[0].size() - 2), "\n");
    result += text("spacing=", first_.geometry.spacing.z, "\nloop=false\n");
    if (auto const step = number_in(attribute("sequence step")); step && volumes_ > 1 && *step > 0)
        result += text("finterval=", *step, "\n");
    if (first_.values != ValueMap{})
        result += text("cf=0\nc0=", first_.values.intercept, "\nc1=", first_.values.slope,
                       "\nvunit=", first_.units.empty() ? "Gray Value" : one_line(first_.units), "\n");
    Header kept = first_;
    kept.timing = kept.dry_run = false;
    if (kept.history) kept.history = parse_history(history_text(*kept.history, most_history));
    if (volumes_ > 1) // of the first one only
        for (char const* const key : {"sequence position", "channel"}) kept.attributes.erase(key);
    return result + tiff_header_line + one_line(to_json(kept)) + "\n";
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
    set(TIFFTAG_COMPRESSION, compress_ ? COMPRESSION_ADOBE_DEFLATE : COMPRESSION_NONE);
    // libtiff has no predictor for half floats, nor for integers of 8 bytes before 4.3.
    if (compress_ && first_.dtype != DataType::float16 && (real || size_of(first_.dtype) < 8))
        set(TIFFTAG_PREDICTOR, real ? PREDICTOR_FLOATINGPOINT : PREDICTOR_HORIZONTAL);
    set(TIFFTAG_RESOLUTIONUNIT, RESUNIT_NONE);
    set(TIFFTAG_XRESOLUTION, 1 / first_.geometry.spacing.x);
    set(TIFFTAG_YRESOLUTION, 1 / first_.geometry.spacing.y);
    if (page_ == 0) set(TIFFTAG_IMAGEDESCRIPTION, description().c_str());
    // ImageJ's own files have one directory and all voxels behind it, and tifffile takes ours for one of them if the
    // voxels of all pages would have room before the second directory: a long description must not lie between them.
    if (page_ == 0 && !compress_ && rows_per_strip_ == static_cast<std::uint32_t>(first_.dims.y))
        need(TIFFCheckpointDirectory(tiff_) != 0);
    in_page_ = true;
    rows_done_ = strip_ = 0;
    held_.clear();
}

void TiffWriter::flush_strip() {
    complaint.clear();
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
        complaint.clear();
        need(TIFFWriteDirectory(tiff_) != 0);
        in_page_ = false;
        ++page_;
    }
}

void TiffWriter::close() {
    if (volumes_ == 0) throw Error(ErrorKind::data, "there is no volume to write");
    complaint.clear();
    if (volumes_ > 1) { // their number stands in the first page
        need(TIFFSetDirectory(tiff_, 0) != 0);
        need(TIFFSetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, description().c_str()) != 0);
        need(TIFFRewriteDirectory(tiff_) != 0);
    }
    need(TIFFFlush(tiff_) != 0);
    TIFFClose(std::exchange(tiff_, nullptr));
    if (!complaint.empty()) fail();
    file_.commit();
}

} // namespace

std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options) {
    return std::make_unique<TiffWriter>(path, options);
}

} // namespace vkt::tiff
