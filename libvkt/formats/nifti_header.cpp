// The bytes of NIfTI headers, both ways by one table of fields.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/nifti_header.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/nifti_fields.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

namespace vkt {

namespace {

using namespace std::string_view_literals;

constexpr std::size_t size1 = 348, size2 = 540;
constexpr std::int64_t most_extension = std::int64_t{16} << 20;
constexpr int comment_code = 6; ///< of extensions that are text
constexpr std::string_view extension_mark = "vkt header: ";
constexpr std::size_t reserve = 32; ///< a multiple of 16

/// Where each field lies in version 1 and in version 2, and how many bytes it has there.
template <class Fields, class Visit> void visit(Fields& f, int version, Visit const& v) {
    bool const two = version == 2;
    auto const at = [&](std::size_t one, std::size_t in_two) { return two ? in_two : one; };
    std::size_t const real = two ? 8 : 4, whole = two ? 8 : 2, code = two ? 4 : 2;
    for (std::size_t i = 0; i < 8; ++i) v.integer(f.dim[i], at(40, 16) + i * whole, whole);
    for (std::size_t i = 0; i < 8; ++i) v.real(f.pixdim[i], at(76, 104) + i * real, real);
    for (std::size_t i = 0; i < 3; ++i) v.real(f.intent_p[i], at(56, 80) + i * real, real);
    v.integer(f.intent_code, at(68, 504), code);
    v.integer(f.datatype, at(70, 12), 2);
    v.integer(f.bitpix, at(72, 14), 2);
    if (two)
        v.integer(f.vox_offset, 168, 8);
    else
        v.offset(f.vox_offset, 108);
    v.real(f.scl_slope, at(112, 176), real);
    v.real(f.scl_inter, at(116, 184), real);
    v.real(f.cal_max, at(124, 192), real);
    v.real(f.cal_min, at(128, 200), real);
    v.real(f.toffset, at(136, 216), real);
    v.integer(f.xyzt_units, at(123, 500), two ? 4 : 1);
    v.words(f.descrip, at(148, 240), 80);
    v.words(f.aux_file, at(228, 320), 24);
    v.integer(f.qform_code, at(252, 344), code);
    v.integer(f.sform_code, at(254, 348), code);
    for (std::size_t i = 0; i < 3; ++i) v.real(f.quatern[i], at(256, 352) + i * real, real);
    for (std::size_t i = 0; i < 3; ++i) v.real(f.qoffset[i], at(268, 376) + i * real, real);
    for (std::size_t i = 0; i < 12; ++i) v.real(f.srow[i], at(280, 400) + i * real, real);
    v.words(f.intent_name, at(328, 508), 16);
    v.integer(f.slice_code, at(122, 496), two ? 4 : 1);
    v.integer(f.slice_start, at(74, 224), whole);
    v.integer(f.slice_end, at(120, 232), whole);
    v.real(f.slice_duration, at(132, 208), real);
    v.integer(f.dim_info, at(39, 524), 1);
}

std::uint64_t bits_at(std::span<std::byte const> bytes, std::size_t at, std::size_t n, bool big_endian) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < n; ++i)
        value = value << 8 | std::to_integer<std::uint64_t>(bytes[at + (big_endian ? i : n - 1 - i)]);
    return value;
}

std::int64_t integer_at(std::span<std::byte const> bytes, std::size_t at, std::size_t n, bool big_endian) {
    std::uint64_t const bits = bits_at(bytes, at, n, big_endian);
    if (n == 1) return static_cast<std::int64_t>(bits); // sets of bits, and codes
    unsigned const unused = static_cast<unsigned>(64 - 8 * n);
    return static_cast<std::int64_t>(bits << unused) >> unused;
}

class Decoder {
public:
    Decoder(NiftiHeader const& header, std::span<std::byte const> bytes) : header_(header), bytes_(bytes) {}

    void integer(std::int64_t& value, std::size_t at, std::size_t n) const {
        value = integer_at(bytes_, at, n, header_.big_endian);
    }
    void real(double& value, std::size_t at, std::size_t n) const {
        std::uint64_t const bits = bits_at(bytes_, at, n, header_.big_endian);
        value = n == 8 ? std::bit_cast<double>(bits)
                       : static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    }
    void offset(std::int64_t& value, std::size_t at) const {
        double number = 0;
        real(number, at, 4);
        if (!(number >= 0 && number < 0x1p62) || number != std::floor(number))
            throw Error(ErrorKind::data, text("'", header_.name, "': voxels cannot begin at byte ", number));
        value = static_cast<std::int64_t>(number);
    }
    void words(std::string& value, std::size_t at, std::size_t n) const {
        auto const* const begin = reinterpret_cast<char const*>(bytes_.data() + at);
        value.assign(begin, std::find(begin, begin + n, '\0'));
    }

private:
    NiftiHeader const& header_;
    std::span<std::byte const> bytes_;
};

/// Little-endian.
void put_bits(std::string& bytes, std::uint64_t bits, std::size_t at, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) bytes[at + i] = static_cast<char>(bits >> (8 * i));
}

class Encoder {
public:
    explicit Encoder(std::string& bytes) : bytes_(bytes) {}

    void integer(std::int64_t value, std::size_t at, std::size_t n) const {
        put_bits(bytes_, static_cast<std::uint64_t>(value), at, n);
    }
    void real(double value, std::size_t at, std::size_t n) const {
        if (n == 8) return put_bits(bytes_, std::bit_cast<std::uint64_t>(value), at, n);
        if (std::isfinite(value) && std::abs(value) > static_cast<double>(std::numeric_limits<float>::max()))
            throw Error(ErrorKind::usage, text("NIfTI-1 cannot hold the number ", value));
        put_bits(bytes_, std::bit_cast<std::uint32_t>(static_cast<float>(value)), at, n);
    }
    void offset(std::int64_t value, std::size_t at) const { real(static_cast<double>(value), at, 4); }
    void words(std::string const& value, std::size_t at, std::size_t n) const {
        std::copy_n(value.begin(), std::min(value.size(), n - 1), bytes_.begin() + static_cast<std::ptrdiff_t>(at));
    }

private:
    std::string& bytes_;
};

bool is_at(std::span<std::byte const> head, std::size_t at, std::string_view bytes) {
    return head.size() >= at + bytes.size() && std::memcmp(head.data() + at, bytes.data(), bytes.size()) == 0;
}

/// Fills in version, byte order and kind. False if this is no header.
bool identify(std::span<std::byte const> head, NiftiHeader& header) {
    if (head.size() < size1) return false;
    for (bool const big : {false, true}) {
        std::uint64_t const size = bits_at(head, 0, 4, big);
        bool const one = size == size1, two = size == size2;
        std::size_t const magic = one ? 344 : 4;
        bool const single = is_at(head, magic, one ? "n+1\0"sv : "n+2\0"sv);
        bool const pair = is_at(head, magic, one ? "ni1\0"sv : "ni2\0"sv);
        if ((!one && !two) || (!single && !pair)) continue;
        header.version = one ? 1 : 2;
        header.big_endian = big;
        header.single = single;
        return true;
    }
    return false;
}

[[noreturn]] void refuse(ByteSource& bytes) {
    if (bytes.peek(size1).size() < size1)
        throw Error(ErrorKind::data, text("'", bytes.name(), "' ended early: a NIfTI header has ",
                                          static_cast<std::int64_t>(size1), " bytes"));
    throw Error(ErrorKind::data, text("'", bytes.name(), "' does not begin with a NIfTI header"));
}

std::string padded(std::string extension) {
    extension.resize((extension.size() + 8 + 15) / 16 * 16 - 8, '\0');
    return extension;
}

/// Extensions up to the voxels, or to the end of a header that is a file of its own.
void read_extensions(ByteSource& bytes, NiftiHeader& header, std::int64_t end) {
    auto const left = [&] { return end - bytes.position(); };
    std::array<std::byte, 4> flags{};
    if (left() < 4 || bytes.peek(4).size() < 4) return;
    bytes.read_exactly(flags.data(), 4);
    if (flags[0] == std::byte{0}) return;
    std::array<std::byte, 8> head{};
    while (left() >= 8 && bytes.peek(8).size() == 8) {
        bytes.read_exactly(head.data(), 8);
        std::int64_t const size = integer_at(head, 0, 4, header.big_endian) - 8;
        // Writers are known that leave other things here; what is no extension is skipped with the rest.
        if (size < 0 || size > left() || size > most_extension) return;
        std::string content(static_cast<std::size_t>(size), '\0');
        bytes.read_exactly(content.data(), content.size());
        std::int64_t const code = integer_at(head, 4, 4, header.big_endian);
        if (code != comment_code) {
            header.not_read.push_back(text("an extension of ", size, " bytes, code ", code));
            continue;
        }
        if (!content.starts_with(extension_mark)) {
            content.resize(std::min(content.size(), content.find('\0')));
            header.comment += (header.comment.empty() ? "" : "\n") + content;
            continue;
        }
        content.resize(std::min(content.size(), content.find('\0')));
        try {
            header.ours = header_from_json(std::string_view(content).substr(extension_mark.size()));
        } catch (Error const&) { // a damaged extension is none
        }
    }
}

} // namespace

bool is_nifti(std::span<std::byte const> head) {
    NiftiHeader header;
    return identify(head, header);
}

NiftiHeader read_nifti_header(ByteSource& bytes) {
    NiftiHeader header;
    header.name = bytes.name();
    std::int64_t const begin = bytes.position();
    if (!identify(bytes.peek(size1), header)) refuse(bytes);
    std::vector<std::byte> block(header.version == 1 ? size1 : size2);
    bytes.read_exactly(block.data(), block.size());
    visit(header.fields, header.version, Decoder(header, block));
    std::int64_t& offset = header.fields.vox_offset;
    std::int64_t const least = static_cast<std::int64_t>(block.size()) + 4;
    if (header.single && offset == 0) offset = least;
    if (offset < (header.single ? least : 0) || offset > std::int64_t{1} << 62)
        throw Error(ErrorKind::data, text("'", header.name, "': voxels cannot begin at byte ", offset));
    read_extensions(bytes, header, begin + (header.single ? offset : most_extension));
    header.position = bytes.position() - begin;
    return header;
}

NiftiFields as_stored(NiftiFields const& fields, int version) {
    NiftiHeader header;
    header.version = version;
    std::string bytes(version == 1 ? size1 : size2, '\0');
    visit(fields, version, Encoder(bytes));
    visit(header.fields, version, Decoder(header, std::as_bytes(std::span(bytes))));
    return header.fields;
}

std::string nifti_bytes(HeaderText const& h) {
    int const version = std::max({h.first.dims.x, h.first.dims.y, h.first.dims.z}) > 32767 ? 2 : 1;
    if (version == 1 && h.volumes > 32767)
        throw Error(ErrorKind::usage, "a NIfTI-1 file holds at most 32767 volumes",
                    "write one file each: name it like out_%05d.nii");
    std::string bytes(version == 1 ? size1 : size2, '\0');
    NiftiFields fields = nifti_fields(h.first, h.volumes, h.channels);
    Header kept = h.first;
    if (kept.history) kept.history = folded(*kept.history, most_history_steps, 400'000);
    std::string extension = padded(std::string(extension_mark) + to_json(kept));
    // What others may read stands before what only vkt does.
    std::string comment;
    if (auto const found = h.first.attributes.find(nifti_comment); found != h.first.attributes.end())
        comment = padded(found->second);
    std::size_t const size = bytes.size(), of_comment = comment.empty() ? 0 : comment.size() + 8,
                      before = size + 4 + of_comment + 8;
    // What volumes behind the first one change may need another word.
    if (h.length == 0 && h.data.empty()) extension.resize(extension.size() + reserve, '\0');
    if (h.length > 0 && before + extension.size() > h.length)
        throw Error(ErrorKind::failure, "no room in the NIfTI header for a series");
    if (h.length > 0) extension.resize(h.length - before, '\0');
    fields.vox_offset = h.data.empty() ? static_cast<std::int64_t>(before + extension.size()) : 0;
    visit(fields, version, Encoder(bytes));
    put_bits(bytes, size, 0, 4);
    std::string_view const magic = version == 1 ? (h.data.empty() ? "n+1\0"sv : "ni1\0"sv)
                                                : (h.data.empty() ? "n+2\0\r\n\032\n"sv : "ni2\0\r\n\032\n"sv);
    std::copy(magic.begin(), magic.end(), bytes.begin() + (version == 1 ? 344 : 4));
    if (version == 1) bytes[38] = 'r'; // "regular", which Analyze's readers look for
    bytes += "\1\0\0\0"sv;
    for (std::string const* const content : {&comment, &extension}) {
        if (content->empty()) continue;
        std::size_t const at = bytes.size();
        bytes.resize(at + 8);
        put_bits(bytes, content->size() + 8, at, 4);
        put_bits(bytes, comment_code, at + 4, 4);
        bytes += *content;
    }
    return bytes;
}

} // namespace vkt
