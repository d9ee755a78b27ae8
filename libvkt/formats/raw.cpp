// Bare voxels: dims, type and byte order stand in the name, as in the Open SciVis data sets, or come from the user.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/raw_name.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/whole_of.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <vector>

namespace vkt {

namespace {

/// "64x32x16"; nullopt if the word is anything else.
std::optional<Index3> parse_extents(std::string_view word) {
    Index3 dims;
    char const* next = word.data();
    char const* const end = next + word.size();
    for (int axis = 0; axis < 3; ++axis) {
        if (axis > 0 && (next == end || (*next++ | 0x20) != 'x')) return std::nullopt;
        auto const result = std::from_chars(next, end, dims[axis]);
        if (result.ec != std::errc{} || dims[axis] < 1) return std::nullopt;
        next = result.ptr;
    }
    return next == end ? std::optional(dims) : std::nullopt;
}

std::optional<DataType> parse_type(std::string_view word) {
    if (word.empty() || word.size() > 8) return std::nullopt;
    try {
        return parse_data_type(word);
    } catch (Error const&) {
        return std::nullopt;
    }
}

/// What a word says of the byte order; `behind` is true if the word before was a type or extents, without which two
/// letters mean anything.
std::optional<bool> parse_order(std::string const& word, std::string const& before, bool behind) {
    bool const pair = word == "endian";
    if (word == "bigendian" || word == "msb" || (pair && before == "big") || (behind && word == "be")) return true;
    if (word == "littleendian" || word == "lsb" || (pair && before == "little") || (behind && word == "le"))
        return false;
    return std::nullopt;
}

bool is_gzip(std::string const& name) { return lower_case(name).ends_with(".gz"); }

std::unique_ptr<Source> open_raw(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    RawName const name = parse_raw_name(bytes->name());
    RawLayout layout;
    if (std::string const whole = whole_of(bytes->name()); !options.dims && !whole.empty())
        throw Error(ErrorKind::usage, text("'", bytes->name(), "': dims are unknown, but '", whole, "' says them"),
                    text("name that: ", shell_quoted(whole)));
    if (!options.dims && !name.dims)
        throw Error(ErrorKind::usage, text("'", bytes->name(), "': dims are unknown"),
                    text("say ", raw_description(bytes->name(), options, "--dims X Y Z --dtype TYPE"),
                         ", or name it like engine_256x256x128_uint8.raw"));
    if (!options.dtype && !name.dtype)
        throw Error(ErrorKind::usage, text("'", bytes->name(), "': the data type is unknown"),
                    text("say ", raw_description(bytes->name(), options, "--dtype TYPE"),
                         ", or name it like engine_256x256x128_uint8.raw"));
    if (options.skip < 0) throw Error(ErrorKind::usage, text("cannot skip ", options.skip, " bytes"));
    layout.header.dims = options.dims ? *options.dims : *name.dims;
    layout.header.dtype = options.dtype ? *options.dtype : *name.dtype;
    if (options.spacing) layout.header.geometry.spacing = *options.spacing;
    layout.encoding = is_gzip(bytes->name()) ? Encoding::deflate : Encoding::raw;
    layout.byte_skip = options.skip;
    layout.big_endian = options.big_endian.value_or(name.big_endian.value_or(false));
    layout.exact = true;
    return raw_source(std::move(bytes), std::move(layout));
}

class RawWriter : public VolumeWriter {
public:
    RawWriter(std::string const& path, WriteOptions const& options)
        : file_(path, options.force), name_(parse_raw_name(path)), big_endian_(name_.big_endian.value_or(false)) {
        if (options.compress && path != "-" && !is_gzip(path))
            throw Error(ErrorKind::usage, "raw files are compressed as a whole, and named so",
                        text("name it ", shell_quoted(path + ".gz")));
        if (options.compress || is_gzip(path)) deflate_.emplace(file_, DeflateWriter::Wrapper::gzip, options);
    }
    void begin(Header const& header) override {
        refuse_bricks(header, "a raw file");
        if (begun_ && (header.dims != dims_ || header.dtype != dtype_))
            throw Error(ErrorKind::usage, "a raw file cannot hold volumes of different dims or types");
        if (name_.dims.value_or(header.dims) != header.dims || name_.dtype.value_or(header.dtype) != header.dtype)
            refuse_name(text(header.dims.x, "x", header.dims.y, "x", header.dims.z, "_", header.dtype));
        dims_ = header.dims;
        dtype_ = header.dtype;
        begun_ = true;
        file_.expect(deflate_ ? least_deflated(header.bytes()) : header.bytes());
    }
    void write(std::byte const* voxels, std::size_t n) override {
        std::size_t const size = size_of(dtype_);
        if (!big_endian_ || size == 1) return put(voxels, n);
        for (std::size_t done = 0; done < n;) {
            std::size_t const count = std::min(n - done, piece);
            swapped_.assign(voxels + done, voxels + done + count);
            swap_bytes(swapped_.data(), count / size, size);
            put(swapped_.data(), count);
            done += count;
        }
    }
    void close() override {
        if (deflate_) deflate_->finish();
        file_.commit();
    }

private:
    static constexpr std::size_t piece = std::size_t{256} << 10; ///< whole voxels of any type

    [[noreturn]] void refuse_name(std::string const& volume) const {
        throw Error(ErrorKind::usage,
                    text("'", file_.path(), "' would be read as what its name says, and the volume is ", volume),
                    text("name it like engine_", volume, ".raw"));
    }
    void put(std::byte const* bytes, std::size_t n) {
        if (deflate_)
            deflate_->write(bytes, n);
        else
            file_.write(bytes, n);
    }

    OutputFile file_;
    RawName name_; ///< what it says a reader will believe
    bool big_endian_;
    std::vector<std::byte> swapped_;
    std::optional<DeflateWriter> deflate_;
    Index3 dims_;
    DataType dtype_ = DataType::uint8;
    bool begun_ = false;
};

std::unique_ptr<Sink> create_raw(std::string const& path, WriteOptions const& options) {
    return slab_sink(std::make_unique<RawWriter>(path, options));
}

} // namespace

RawName parse_raw_name(std::string_view path) {
    RawName result;
    std::size_t const slash = path.rfind('/');
    std::string_view const name = slash == std::string_view::npos ? path : path.substr(slash + 1);
    constexpr std::string_view separators = "_-. ,()[]";
    std::string before;
    bool behind = false; // a word that describes voxels
    for (std::size_t begin = 0; begin < name.size();) {
        std::size_t const end = std::min(name.find_first_of(separators, begin), name.size());
        std::string const word = lower_case(name.substr(begin, end - begin));
        // The last word of its kind wins: a name may begin with anything.
        if (auto const order = parse_order(word, before, behind)) result.big_endian = order;
        auto const dims = parse_extents(word);
        auto type = parse_type(word);
        if (!type && (word.ends_with("be") || word.ends_with("le"))) {
            type = parse_type(word.substr(0, word.size() - 2));
            if (type) result.big_endian = word.ends_with("be");
        }
        if (dims) result.dims = dims;
        if (type) result.dtype = type;
        behind = dims || type;
        before = word;
        begin = end + 1;
    }
    return result;
}

Format raw_format() {
    return {"raw",
            "bare voxels, x fastest, little-endian unless the name says be",
            {".raw", ".raw.gz"},
            nullptr,
            open_raw,
            create_raw};
}

} // namespace vkt
