// Analyze headers (dbh.h of the Mayo Clinic), with the fields that SPM gave another meaning.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/analyze.h"

#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nifti_header.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/spm_matrix.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <utility>

namespace vkt {
namespace {

struct TypeCode {
    std::int64_t code;
    std::int64_t bits;
    DataType type;
};

constexpr TypeCode type_codes[] = {
    {2, 8, DataType::uint8},     {4, 16, DataType::int16}, {8, 32, DataType::int32},    {16, 32, DataType::float32},
    {64, 64, DataType::float64}, {130, 8, DataType::int8}, {132, 16, DataType::uint16}, {136, 32, DataType::uint32},
};
/// What else the format knows: bits, complex numbers, colours.
constexpr std::int64_t foreign_codes[] = {1, 32, 128, 255};

class Fields {
public:
    Fields(std::span<std::byte const> bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

    std::int64_t integer(std::size_t at, std::size_t n) const {
        std::uint64_t const bits = bits_at(at, n);
        unsigned const unused = static_cast<unsigned>(64 - 8 * n);
        return static_cast<std::int64_t>(bits << unused) >> unused;
    }
    double real(std::size_t at) const {
        return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits_at(at, 4))));
    }
    std::string words(std::size_t at, std::size_t n) const {
        auto const* const begin = reinterpret_cast<char const*>(bytes_.data() + at);
        return std::string(trimmed(std::string_view(begin, ::strnlen(begin, n))));
    }
    bool big_endian() const { return big_endian_; }

private:
    std::uint64_t bits_at(std::size_t at, std::size_t n) const {
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < n; ++i)
            value = value << 8 | std::to_integer<std::uint64_t>(bytes_[at + (big_endian_ ? i : n - 1 - i)]);
        return value;
    }

    std::span<std::byte const> bytes_;
    bool big_endian_;
};

std::optional<Fields> fields_of(std::span<std::byte const> head) {
    if (head.size() < analyze_size || is_nifti(head)) return std::nullopt;
    for (bool const big : {false, true}) {
        Fields const f(head, big);
        std::int64_t const dimensions = f.integer(40, 2), type = f.integer(70, 2);
        bool const known =
            std::any_of(std::begin(type_codes), std::end(type_codes),
                        [&](TypeCode const& t) { return t.code == type && t.bits == f.integer(72, 2); }) ||
            std::count(std::begin(foreign_codes), std::end(foreign_codes), type) > 0;
        if (f.integer(0, 4) == std::int64_t{analyze_size} && dimensions >= 1 && dimensions <= 7 && known) return f;
    }
    return std::nullopt;
}

/// As SPM has it: the voxel at the world's origin, counted from 1; none where it lies far outside.
Vec3 origin_voxel(Fields const& f, Index3 dims) {
    Vec3 middle;
    std::array<std::int64_t, 3> said{};
    bool any = false, near = true;
    for (int axis = 0; axis < 3; ++axis) {
        std::int64_t const at = said[static_cast<std::size_t>(axis)] =
            f.integer(253 + 2 * static_cast<std::size_t>(axis), 2);
        any = any || at != 0;
        near = near && at > -dims[axis] && at < 2 * dims[axis];
        middle[axis] = static_cast<double>(dims[axis] - 1) / 2;
    }
    if (!any || !near) return middle;
    return {static_cast<double>(said[0] - 1), static_cast<double>(said[1] - 1), static_cast<double>(said[2] - 1)};
}

void place(Header& header, Fields const& f) {
    Geometry& g = header.geometry;
    Vec3 const voxel = origin_voxel(f, header.dims);
    g.direction[0] = {-1, 0, 0};
    for (int axis = 0; axis < 3; ++axis) {
        double const s = std::abs(f.real(80 + 4 * static_cast<std::size_t>(axis)));
        g.spacing[axis] = s > 0 && std::isfinite(s) ? s : 1;
        g.origin[axis] = (axis == 0 ? voxel[axis] : 0.0 - voxel[axis]) * g.spacing[axis];
    }
    header.attributes["space"] = "right-anterior-superior";
    header.attributes["orientation"] = "assumed: Analyze does not say left from right; x to the left, as SPM has it";
}

std::unique_ptr<Source> open_analyze(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    RawLayout layout = read_analyze(*bytes, options.trust_paths);
    return raw_source(std::move(bytes), std::move(layout));
}

/// What SPM keeps beside a pair places it anew.
void place_by_matrix(RawLayout& layout, std::string const& header, bool trust_paths) {
    namespace fs = std::filesystem;
    std::string path = spm_matrix_beside(header);
    std::string const name = fs::path(path).filename().string();
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return;
    try {
        path = beside(header, name, trust_paths);
    } catch (Error const&) { // a link to elsewhere
        layout.not_read.push_back(text("'", name, "', which leads out of its directory"));
        return;
    }
    auto const matrix = read_spm_matrix(path);
    if (!matrix) {
        layout.not_read.push_back(
            text("'", name, "', which is no file of SPM's: no map mat or M in MATLAB's version 4 or 5"));
        return;
    }
    layout.header.geometry = matrix->geometry;
    if (matrix->sided) layout.header.attributes.erase("orientation");
    if (matrix->others_differ)
        layout.not_read.push_back(text("places of their own of all volumes but the first, in '", name, "'"));
}

std::string analyze_type_name(DataType type) {
    bool const known =
        std::any_of(std::begin(type_codes), std::end(type_codes), [&](TypeCode const& t) { return t.type == type; });
    return known ? std::string(name_of(type)) : std::string();
}

/// Which voxel lies at the world's origin, if x runs to the left, y to anterior and z to superior.
Vec3 voxel_at_origin(Geometry const& g) {
    return {g.origin.x / g.spacing.x, -g.origin.y / g.spacing.y, -g.origin.z / g.spacing.z};
}

std::string analyze_bytes(HeaderText const& h) {
    std::string bytes(analyze_size, '\0');
    auto const bits = [&](std::size_t at, std::uint64_t value, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) bytes[at + i] = static_cast<char>(value >> (8 * i));
    };
    auto const integer = [&](std::size_t at, std::int64_t value) {
        if (value > 32767)
            throw Error(ErrorKind::usage, text("Analyze cannot hold an extent of ", value), "write NIfTI: out.nii");
        bits(at, static_cast<std::uint64_t>(value), 2);
    };
    auto const real = [&](std::size_t at, double value) {
        bits(at, std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
    };
    bits(0, analyze_size, 4);
    bits(32, 16384, 4);
    bytes[38] = 'r';
    integer(40, h.volumes > 1 ? 4 : 3);
    Geometry const g = geometry_in("right-anterior-superior", h.first);
    Vec3 const at = voxel_at_origin(g);
    bool near = true, middle = true;
    for (int a = 0; a < 3; ++a) {
        auto const i = static_cast<std::size_t>(a);
        std::int64_t const n = h.first.dims[a];
        integer(42 + 2 * i, n);
        real(80 + 4 * i, g.spacing[a]);
        near = near && at[a] > static_cast<double>(-n) && at[a] < static_cast<double>(2 * n - 1);
        middle = middle && at[a] == static_cast<double>(n - 1) / 2;
    }
    for (int a = 0; a < 3 && near && !middle; ++a)
        bits(253 + 2 * static_cast<std::size_t>(a), static_cast<std::uint64_t>(std::llround(at[a]) + 1), 2);
    integer(48, h.volumes);
    bytes.replace(56, 2, "mm");
    for (TypeCode const& t : type_codes)
        if (t.type == h.first.dtype) integer(70, t.code), integer(72, t.bits);
    real(112, h.first.values.slope);
    real(116, h.first.values.intercept);
    auto const found = h.first.attributes.find("descrip");
    std::string const words = found == h.first.attributes.end() ? "" : found->second.substr(0, 79);
    std::copy(words.begin(), words.end(), bytes.begin() + 148);
    return bytes;
}

class AnalyzeWriter : public HeaderAndVoxelsWriter {
public:
    AnalyzeWriter(std::string const& path, WriteOptions const& options)
        : HeaderAndVoxelsWriter({"Analyze", ".hdr", ".hdr", ".img", "", DeflateWriter::Wrapper::gzip, false,
                                 analyze_type_name, analyze_bytes},
                                path, options),
          options_(options) {}

    void begin(Header const& header) override {
        HeaderAndVoxelsWriter::begin(header);
        if (std::exchange(begun_, true)) return;
        Header shown = header;
        Geometry& g = shown.geometry = geometry_in("right-anterior-superior", header);
        // As the format has it: directions are given, and the origin is a voxel, or the middle of the volume.
        g.direction[0] = {-g.direction[0].x, -g.direction[0].y, -g.direction[0].z};
        Vec3 const at = voxel_at_origin(g);
        bool whole = true, middle = true;
        for (int a = 0; a < 3; ++a) {
            auto const n = static_cast<double>(header.dims[a]);
            whole = whole && std::abs(at[a] - std::round(at[a])) < 1e-4 && at[a] > -n && at[a] < 2 * n - 1;
            middle = middle && at[a] == (n - 1) / 2;
        }
        bool const plain = (whole || middle) && g.direction == Geometry{}.direction;
        if (put_matrix(geometry_in("right-anterior-superior", header), plain)) g = {};
        if (whole || middle) {
            g.spacing = {1, 1, 1};
            g.origin = {};
        }
        shown.values = {};
        auto& attributes = shown.attributes;
        if (is_anatomical(frame_of(header))) attributes.erase("space"); // turned into the format's
        if (auto const unit = attributes.find("space units");
            unit != attributes.end() && unit->second == "\"mm\" \"mm\" \"mm\"")
            attributes.erase(unit);
        attributes.erase("orientation"); // it comes again
        if (auto const words = attributes.find("descrip"); words != attributes.end() && words->second.size() < 80)
            attributes.erase(words);
        tell_losses(options_, shown, "Analyze files", nothing_kept);
    }

    void close() override {
        if (matrix_) matrix_->commit();
        HeaderAndVoxelsWriter::close();
    }

private:
    /// SPM's file for what the header has no place for, and where there is one, which would misplace what is new.
    bool put_matrix(Geometry const& geometry, bool plain) {
        std::string const path = spm_matrix_beside(target());
        std::error_code error;
        bool const there = std::filesystem::exists(path, error), ours = !there || read_spm_matrix(path).has_value();
        if (plain && (!there || !ours)) return false;
        if (!ours)
            throw Error(ErrorKind::io,
                        text("cannot write '", path, "', the place of the volume: it is no file of SPM's"),
                        "choose another name");
        matrix_.emplace(path, options_.force);
        std::string const bytes = spm_matrix_bytes(geometry);
        matrix_->write(bytes.data(), bytes.size());
        return true;
    }

    WriteOptions options_;
    std::optional<OutputFile> matrix_;
    bool begun_ = false;
};

std::unique_ptr<Sink> create_analyze(std::string const& path, WriteOptions const& options) {
    if (!lower_case(path).ends_with(".hdr"))
        throw Error(ErrorKind::usage, "an Analyze pair is written by the name of its header", "write NAME.hdr");
    return slab_sink(std::make_unique<AnalyzeWriter>(path, options));
}

} // namespace

bool is_analyze(std::span<std::byte const> head) { return fields_of(head).has_value(); }

RawLayout read_analyze(ByteSource& bytes, bool trust_paths) {
    std::string const name = bytes.name();
    auto const fail = [&](std::string const& what) { throw Error(ErrorKind::data, text("'", name, "': ", what)); };
    std::vector<std::byte> block(analyze_size);
    bytes.read_exactly(block.data(), block.size());
    std::optional<Fields> const f = fields_of(block);
    if (!f) fail("no Analyze header");
    RawLayout layout;
    layout.big_endian = f->big_endian();
    std::int64_t const dimensions = f->integer(40, 2);
    for (std::int64_t i = 1; i <= dimensions; ++i) {
        std::int64_t const n = f->integer(40 + 2 * static_cast<std::size_t>(i), 2);
        if (n < 1) fail(text("an extent of ", n));
        if (i <= 3)
            layout.header.dims[static_cast<int>(i) - 1] = n;
        else if (i == 4)
            layout.volumes = n;
        else if (n > 1)
            fail("more than four dimensions");
    }
    auto const type = std::find_if(std::begin(type_codes), std::end(type_codes),
                                   [&](TypeCode const& t) { return t.code == f->integer(70, 2); });
    if (type == std::end(type_codes))
        fail("its voxels are bits, complex numbers or colours; a volume has one number in each");
    layout.header.dtype = type->type;
    place(layout.header, *f);
    if (double const slope = f->real(112), intercept = f->real(116); slope != 0 && std::isfinite(slope))
        layout.header.values = {slope, std::isfinite(intercept) ? intercept : 0};
    if (std::string const words = f->words(148, 80); !words.empty()) layout.header.attributes["descrip"] = words;
    if (f->words(56, 4) == "mm") layout.header.attributes["space units"] = "\"mm\" \"mm\" \"mm\"";
    double const offset = std::abs(f->real(108));
    if (!(offset < 0x1p62) || offset != std::floor(offset)) fail(text("voxels cannot begin at byte ", offset));
    layout.byte_skip = static_cast<std::int64_t>(offset);
    find_image(layout, name, trust_paths);
    place_by_matrix(layout, name, trust_paths);
    layout.header = in_utf8(std::move(layout.header));
    return layout;
}

Format analyze_format() {
    return {"analyze", "Analyze 7.5, a pair", {".hdr", ".img"}, is_analyze, open_analyze, create_analyze};
}

} // namespace vkt
