// Pictures of a single slice, a pixel a voxel: PNG and PGM, grey, 8 or 16 bits; PFM and OpenEXR, floats. PNG is read
// here, the others in picture_source.cpp.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/exr.h"
#include "libvkt/formats/pfm.h"
#include "libvkt/formats/picture_source.h"
#include "libvkt/formats/picture_texts.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/kernel/rows.h"

#include <png.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

namespace vkt {
namespace {

/// What both formats ask of a volume.
class PictureWriter : public VolumeWriter {
public:
    PictureWriter(std::string const& path, WriteOptions const& options, char const* name)
        : held_file_(std::make_unique<OutputFile>(path, options.force)), file_(*held_file_), name_(name),
          files_(options.files), held_(options.held) {
        if (options.compress)
            throw Error(ErrorKind::usage,
                        text("--compress: ", name, " files are compressed in their own way, or not at all"));
    }
    void begin(Header const& header) override {
        refuse_bricks(header, one_file());
        if (header.dims.z != 1)
            throw Error(ErrorKind::usage, text(one_file(), " holds one slice, the volume has ", header.dims.z),
                        "all of them: -o slice%04d.png; one of them: vkt slice");
        check_type(header.dtype);
        if (std::exchange(begun_, true))
            throw Error(ErrorKind::usage, text("the input holds several volumes, ", one_file(), " holds one"),
                        "give a place for the number: -o slice-%04d.png");
        if (header.dims.x > most_pixels || header.dims.y > most_pixels)
            throw Error(ErrorKind::usage, text("a picture of ", header.dims.x, " by ", header.dims.y,
                                               " pixels is too large for ", name_));
        if (header.history) texts_ = texts_of_history(*header.history);
        row_ = static_cast<std::size_t>(header.dims.x) * size_of(header.dtype);
        file_.expect(least_bytes(header) * static_cast<std::size_t>(files_));
        begin_picture(header.dims, header.dtype);
    }
    /// Pieces of a slice are whole rows.
    void write(std::byte const* voxels, std::size_t n) override {
        for (std::size_t done = 0; done < n; done += row_) put_row(voxels + done);
    }
    void close() override {
        if (held_)
            held_->push_back(std::move(held_file_));
        else
            file_.commit();
    }

protected:
    /// Throws Error{usage} for types that the format does not hold.
    virtual void check_type(DataType type) const {
        if (type != DataType::uint8 && type != DataType::uint16)
            throw Error(
                ErrorKind::usage, text(one_file(), " holds uint8 or uint16, not ", type),
                "map values to 256 levels: --range LO:HI of 'vkt slice', or vkt convert --dtype uint8 --range p1:p99");
    }
    /// That a file takes.
    virtual std::size_t least_bytes(Header const& header) const { return least_deflated(header.bytes()); }
    virtual void begin_picture(Index3 dims, DataType type) = 0;
    virtual void put_row(std::byte const* pixels) = 0;

    std::string one_file() const { return text(name_[0] == 'O' ? "an " : "a ", name_, " file"); }

    std::unique_ptr<OutputFile> held_file_;
    OutputFile& file_;
    std::size_t row_ = 0; ///< bytes
    PictureTexts texts_;  ///< for formats that have a place for them
    char const* name_;
    std::int64_t files_; ///< this one and those to come
    std::shared_ptr<HeldFiles> held_;

private:
    static constexpr std::int64_t most_pixels = 1000000; // what libpng and most readers allow

    bool begun_ = false;
};

class PgmWriter : public PictureWriter {
public:
    PgmWriter(std::string const& path, WriteOptions const& options) : PictureWriter(path, options, "PGM") {}

protected:
    std::size_t least_bytes(Header const& header) const override { return header.bytes(); }
    void begin_picture(Index3 dims, DataType type) override {
        wide_ = type == DataType::uint16;
        std::string const head = text("P5\n", dims.x, " ", dims.y, "\n", wide_ ? 65535 : 255, "\n");
        file_.write(head.data(), head.size());
    }
    void put_row(std::byte const* pixels) override {
        if (!wide_) return file_.write(pixels, row_);
        swapped_.resize(row_);
        for (std::size_t i = 0; i < row_; ++i) swapped_[i] = pixels[i ^ 1]; // most significant byte first
        file_.write(swapped_.data(), row_);
    }

private:
    bool wide_ = false;
    std::vector<std::byte> swapped_;
};

class PngWriter : public PictureWriter {
public:
    PngWriter(std::string const& path, WriteOptions const& options)
        : PictureWriter(path, options, "PNG"),
          png_(png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, fail, ignore)) {
        if (png_ != nullptr) info_ = png_create_info_struct(png_);
        if (info_ != nullptr) return;
        png_destroy_write_struct(&png_, nullptr);
        throw Error(ErrorKind::resources, "no memory for the PNG encoder");
    }
    ~PngWriter() override { png_destroy_write_struct(&png_, &info_); }
    PngWriter(PngWriter const&) = delete;
    PngWriter& operator=(PngWriter const&) = delete;

    void end() override { png_write_end(png_, info_); }

protected:
    void begin_picture(Index3 dims, DataType type) override {
        bool const wide = type == DataType::uint16;
        png_set_write_fn(png_, &file_, put, flush);
        png_set_IHDR(png_, info_, static_cast<png_uint_32>(dims.x), static_cast<png_uint_32>(dims.y), wide ? 16 : 8,
                     PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
        png_set_compression_level(png_, 5);
        png_write_info(png_, info_);
        for (auto const& [keyword, content] : texts_) {
            std::string const chunk = png_text_chunk(keyword, content);
            file_.write(chunk.data(), chunk.size());
        }
        if (wide && std::endian::native == std::endian::little) png_set_swap(png_);
    }
    void put_row(std::byte const* pixels) override { png_write_row(png_, reinterpret_cast<png_const_bytep>(pixels)); }

private:
    static void put(png_structp png, png_bytep data, std::size_t n) {
        static_cast<OutputFile*>(png_get_io_ptr(png))->write(data, n);
    }
    static void flush(png_structp) {}
    [[noreturn]] static void fail(png_structp, char const* message) {
        std::string const what = message;
        bool const memory = what.find("memory") != std::string::npos;
        throw Error(memory ? ErrorKind::resources : ErrorKind::failure, "cannot encode PNG: " + what);
    }
    static void ignore(png_structp, char const*) {}

    png_structp png_ = nullptr;
    png_infop info_ = nullptr;
};

using namespace std::string_view_literals;

bool is_png(std::span<std::byte const> head) {
    constexpr std::string_view magic = "\x89PNG\r\n\x1a\n"sv;
    return head.size() >= magic.size() && std::memcmp(head.data(), magic.data(), magic.size()) == 0;
}

/// Grey pictures, also those that say their grey in three colours, row by row as they are decoded.
class PngSource : public Source {
public:
    PngSource(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
    ~PngSource() override { png_destroy_read_struct(&png_, &info_, nullptr); }
    PngSource(PngSource const&) = delete;
    PngSource& operator=(PngSource const&) = delete;

    bool next_volume() override { return !std::exchange(begun_, true); }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::forward; }
    void read(AnyView out) override;
    std::vector<std::string> not_read() const override;
    void finish() override {
        if (std::exchange(finished_, true)) return;
        skip_to(header_.dims.y);
        if (picture_.empty()) png_read_end(png_, nullptr);
    }

private:
    static constexpr png_uint_32 most_pixels = 1000000;

    static void take(png_structp png, png_bytep to, std::size_t n) {
        static_cast<ByteSource*>(png_get_io_ptr(png))->read_exactly(to, n);
    }
    [[noreturn]] static void fail(png_structp png, char const* message) {
        auto const* const bytes = static_cast<ByteSource const*>(png_get_io_ptr(png));
        throw Error(ErrorKind::data,
                    text("'", bytes != nullptr ? bytes->name() : "a picture", "': damaged PNG: ", message));
    }
    static void ignore(png_structp, char const*) {}
    void decode_all(std::size_t memory);
    void next_row();
    void skip_to(std::int64_t row) {
        while (row_ < row) next_row();
    }

    std::unique_ptr<ByteSource> bytes_;
    png_structp png_ = nullptr;
    png_infop info_ = nullptr;
    Header header_;
    int channels_ = 1;
    std::size_t row_bytes_ = 0;     ///< as decoded
    std::vector<png_byte> held_;    ///< the last row, as decoded
    std::vector<png_byte> picture_; ///< all rows, if they are interlaced
    std::int64_t row_ = 0;          ///< rows that were decoded
    bool begun_ = false, finished_ = false;
};

PngSource::PngSource(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) : bytes_(std::move(bytes)) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, fail, ignore);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) throw Error(ErrorKind::resources, "no memory for the PNG decoder");
    try {
        png_set_read_fn(png_, bytes_.get(), take);
        png_set_user_limits(png_, most_pixels, most_pixels);
        png_set_chunk_malloc_max(png_, png_alloc_size_t{8} << 20);
        png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, 0);
        png_read_info(png_, info_);
        int const depth = png_get_bit_depth(png_, info_), color = png_get_color_type(png_, info_);
        if (color == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png_);
        if (color == PNG_COLOR_TYPE_GRAY && depth < 8) png_set_packing(png_); // numbers as they are, not spread
        if (depth == 16 && std::endian::native == std::endian::little) png_set_swap(png_);
        bool const interlaced = png_get_interlace_type(png_, info_) != PNG_INTERLACE_NONE;
        if (interlaced) png_set_interlace_handling(png_);
        png_read_update_info(png_, info_);
        channels_ = png_get_channels(png_, info_);
        header_.dims = {static_cast<std::int64_t>(png_get_image_width(png_, info_)),
                        static_cast<std::int64_t>(png_get_image_height(png_, info_)), 1};
        header_.dtype = depth == 16 ? DataType::uint16 : DataType::uint8;
        if (options.spacing) header_.geometry.spacing = *options.spacing;
        check(header_);
        row_bytes_ = png_get_rowbytes(png_, info_);
        held_.resize(row_bytes_);
        mark_as_given(header_);
        if (interlaced) decode_all(options.memory.value_or(default_memory()));
    } catch (...) {
        png_destroy_read_struct(&png_, &info_, nullptr);
        throw;
    }
}

/// Rows of interlaced pictures come in seven rounds.
void PngSource::decode_all(std::size_t memory) {
    auto const rows = static_cast<std::size_t>(header_.dims.y);
    if (row_bytes_ > memory / rows)
        throw Error(ErrorKind::resources,
                    text("'", bytes_->name(), "' is interlaced and has to be held whole, which is beyond --memory"));
    picture_.resize(row_bytes_ * rows);
    std::vector<png_bytep> pointers(rows);
    for (std::size_t y = 0; y < rows; ++y) pointers[y] = picture_.data() + y * row_bytes_;
    png_read_image(png_, pointers.data());
    png_read_end(png_, nullptr);
}

void PngSource::next_row() {
    if (picture_.empty())
        png_read_row(png_, held_.data(), nullptr);
    else
        std::memcpy(held_.data(), picture_.data() + static_cast<std::size_t>(row_) * row_bytes_, row_bytes_);
    ++row_;
    if (channels_ == 1) return;
    // One grey remains of equal colours that hide nothing.
    std::size_t const size = size_of(header_.dtype), pixel = static_cast<std::size_t>(channels_) * size;
    bool const alpha = channels_ == 2 || channels_ == 4;
    for (std::size_t x = 0; x < static_cast<std::size_t>(header_.dims.x); ++x) {
        png_byte const* const p = held_.data() + x * pixel;
        for (std::size_t c = 1; c + (alpha ? 1 : 0) < static_cast<std::size_t>(channels_); ++c)
            if (std::memcmp(p, p + c * size, size) != 0)
                throw Error(ErrorKind::data,
                            text("'", bytes_->name(), "' has colours; a volume has one number in each voxel"),
                            "ImageMagick makes it grey: convert in.png -colorspace Gray out.png");
        for (std::size_t i = pixel - size; alpha && i < pixel; ++i)
            if (p[i] != 255)
                throw Error(ErrorKind::data, text("'", bytes_->name(),
                                                  "' is transparent in places; a volume has one number in each voxel"));
        std::memmove(held_.data() + x * size, p, size);
    }
}

/// Whether pixels are grey is known only after they are decoded.
std::vector<std::string> PngSource::not_read() const {
    if (channels_ == 1) return {};
    char const* const what = channels_ == 2 ? "transparency" : channels_ == 3 ? "colours" : "colours and transparency";
    return {text("pixels of ", channels_, " channels, ", what, ", are refused unless all are opaque and grey")};
}

void PngSource::read(AnyView out) {
    std::size_t const size = size_of(header_.dtype);
    for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y) {
        if (row_ > y + 1) throw Error(ErrorKind::failure, text("'", bytes_->name(), "' can only be read forward"));
        skip_to(y + 1);
        std::memcpy(out.at(out.box.lower.x, y, 0), held_.data() + static_cast<std::size_t>(out.box.lower.x) * size,
                    static_cast<std::size_t>(out.dims().x) * size);
    }
}

std::unique_ptr<Source> open_png(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    return std::make_unique<PngSource>(std::move(bytes), options);
}

/// Holds the slice until it is whole: both formats have what comes last first, rows or a table.
class FloatWriter : public PictureWriter {
public:
    using PictureWriter::PictureWriter;
    void end() override {
        std::vector<std::byte> const bytes = encoded();
        file_.write(bytes.data(), bytes.size());
    }

protected:
    virtual std::vector<std::byte> encoded() = 0;
    void check_type(DataType type) const override {
        constexpr DataType exact[] = {DataType::uint8, DataType::int8,    DataType::uint16,
                                      DataType::int16, DataType::float16, DataType::float32};
        if (std::find(std::begin(exact), std::end(exact), type) == std::end(exact))
            throw Error(ErrorKind::usage, text(one_file(), " holds what float32 can, not ", type),
                        "vkt convert --dtype float32 rounds");
    }
    void begin_picture(Index3 dims, DataType type) override {
        width_ = static_cast<int>(dims.x), height_ = static_cast<int>(dims.y);
        type_ = type;
        values_.reserve(static_cast<std::size_t>(dims.x * dims.y));
    }
    void put_row(std::byte const* pixels) override {
        double piece[baseline::row_piece];
        for (std::int64_t i = 0; i < width_; i += baseline::row_piece) {
            std::int64_t const n = std::min(baseline::row_piece, width_ - i);
            baseline::load_row(type_, pixels + static_cast<std::size_t>(i) * size_of(type_), piece, n);
            for (std::int64_t k = 0; k < n; ++k) values_.push_back(static_cast<float>(piece[k]));
        }
    }

    int width_ = 0, height_ = 0;
    DataType type_ = DataType::float32;
    std::vector<float> values_;
};

class PfmWriter : public FloatWriter {
public:
    PfmWriter(std::string const& path, WriteOptions const& options) : FloatWriter(path, options, "PFM") {}

protected:
    std::size_t least_bytes(Header const& header) const override {
        return static_cast<std::size_t>(header.dims.x * header.dims.y) * sizeof(float);
    }
    std::vector<std::byte> encoded() override { return pfm_bytes({width_, height_, 1, std::move(values_)}); }
};

class ExrWriter : public FloatWriter {
public:
    ExrWriter(std::string const& path, WriteOptions const& options)
        : FloatWriter(path, options, "OpenEXR"), what_(text(path, ": writing OpenEXR")) {
        require_exr(what_);
    }

protected:
    std::vector<std::byte> encoded() override {
        FloatPicture picture;
        picture.width = width_, picture.height = height_;
        picture.planes.push_back({"Y", std::move(values_), type_ == DataType::float16});
        picture.texts = texts_;
        return exr_bytes(picture, what_);
    }

private:
    std::string what_;
};

template <class Writer> std::unique_ptr<Sink> create(std::string const& path, WriteOptions const& options) {
    return slab_sink(std::make_unique<Writer>(path, options));
}

} // namespace

Format png_format() {
    return {"png",    "a slice as a grey picture; NAME%04d.png or a folder, a volume",
            {".png"}, is_png,
            open_png, create<PngWriter>,
            false,    true};
}

Format pgm_format() {
    return {"pgm", "a slice as a grey picture", {".pgm", ".ppm"}, is_pgm, open_pgm, create<PgmWriter>, false, true};
}

Format pfm_format() {
    return {"pfm", "a slice as a picture of floats", {".pfm"}, is_pfm, open_pfm, create<PfmWriter>, false, true, true};
}

Format exr_format() {
    return {"exr", "a slice as an OpenEXR picture", {".exr"}, is_exr, open_exr, create<ExrWriter>, false, true, true};
}

} // namespace vkt
