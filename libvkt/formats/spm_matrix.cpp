// MATLAB's files of versions 4 and 5, as far as matrices of numbers go.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/spm_matrix.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string_view>
#include <vector>

namespace vkt {
namespace {

constexpr std::size_t most_bytes = std::size_t{16} << 20;

/// Of 4 by 4 numbers, first along columns; several one behind another.
using Matrices = std::map<std::string, std::vector<double>>;

/// Thrown by who reads beyond the end, or finds what the format does not know; caught where the file is given up.
struct NoMatlabFile {};

/// A part of the file, read from the front.
class Bytes {
public:
    Bytes(std::string_view all, bool big_endian) : rest_(all), big_endian_(big_endian) {}

    bool empty() const { return rest_.empty(); }
    std::size_t size() const { return rest_.size(); }
    std::string_view take(std::size_t n) {
        if (n > rest_.size()) throw NoMatlabFile();
        std::string_view const result = rest_.substr(0, n);
        rest_.remove_prefix(n);
        return result;
    }
    std::uint64_t bits(std::size_t n) {
        std::string_view const word = take(n);
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < n; ++i)
            value = value << 8 | static_cast<unsigned char>(word[big_endian_ ? i : n - 1 - i]);
        return value;
    }
    std::uint32_t number() { return static_cast<std::uint32_t>(bits(4)); }
    Bytes part(std::size_t n) { return {take(n), big_endian_}; }
    bool big_endian() const { return big_endian_; }

private:
    std::string_view rest_;
    bool big_endian_;
};

enum class Element : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

double element(Bytes& from, Element type) {
    switch (type) {
    case Element::int8:
        return static_cast<std::int8_t>(from.bits(1));
    case Element::uint8:
        return static_cast<double>(from.bits(1));
    case Element::int16:
        return static_cast<std::int16_t>(from.bits(2));
    case Element::uint16:
        return static_cast<double>(from.bits(2));
    case Element::int32:
        return static_cast<std::int32_t>(from.bits(4));
    case Element::uint32:
        return static_cast<double>(from.bits(4));
    case Element::float32:
        return static_cast<double>(std::bit_cast<float>(from.number()));
    case Element::float64:
        break;
    }
    return std::bit_cast<double>(from.bits(8));
}

std::size_t size_of(Element type) {
    constexpr std::array<std::size_t, 8> sizes{1, 1, 2, 2, 4, 4, 4, 8};
    return sizes[static_cast<std::size_t>(type)];
}

std::vector<double> elements(Bytes from, Element type, std::size_t n) {
    if (n > from.size() / size_of(type)) throw NoMatlabFile();
    std::vector<double> result;
    result.reserve(n);
    for (std::size_t i = 0; i < n; ++i) result.push_back(element(from, type));
    return result;
}

bool is_version_4(std::string_view all) {
    for (bool const big : {false, true})
        if (all.size() >= 20 && Bytes(all, big).number() < 5000) return true;
    return false;
}

/// Each matrix has a head of five numbers; the first one tells order of bytes, type and kind by its decimal digits.
Matrices read_version_4(std::string_view all) {
    Matrices result;
    constexpr std::array<Element, 6> types{Element::float64, Element::float32, Element::int32,
                                           Element::int16,   Element::uint16,  Element::uint8};
    bool const big = Bytes(all, false).number() >= 5000;
    for (Bytes file(all, big); !file.empty();) {
        std::uint32_t const kind = file.number(), rows = file.number(), columns = file.number(),
                            complex = file.number(), letters = file.number();
        std::uint32_t const type = kind / 10 % 10;
        if (kind >= 5000 || kind / 1000 != (big ? 1U : 0U) || type >= types.size() || kind % 10 > 1)
            throw NoMatlabFile(); // sparse ones, too
        std::string_view const name = file.take(letters);
        std::uint64_t const n = std::uint64_t{rows} * columns;
        if (n > most_bytes) throw NoMatlabFile();
        Bytes const values = file.part(static_cast<std::size_t>(n) * size_of(types[type]) * (complex != 0 ? 2 : 1));
        if (rows == 4 && columns == 4 && complex == 0)
            result[std::string(name.substr(0, name.find('\0')))] = elements(values, types[type], 16);
    }
    return result;
}

/// What a data element of version 5 holds; those of up to four bytes have them in their tag.
struct Tagged {
    std::uint32_t type = 0;
    Bytes data;
};

constexpr std::uint32_t matrix_element = 14, compressed_element = 15;

Tagged next_element(Bytes& from) {
    std::uint32_t const word = from.number();
    if (word >> 16 != 0) {
        Bytes four = from.part(4);
        return {word & 0xFFFF, four.part(word >> 16)};
    }
    std::uint32_t const n = from.number();
    Tagged result{word, from.part(n)};
    bool const padded = word != compressed_element;
    if (padded) from.take(std::min<std::size_t>((8 - n % 8) % 8, from.size()));
    return result;
}

std::optional<Element> type_numbered(std::uint32_t number) {
    constexpr std::array<Element, 6> integers{Element::int8,   Element::uint8, Element::int16,
                                              Element::uint16, Element::int32, Element::uint32};
    if (number >= 1 && number <= integers.size()) return integers[number - 1];
    if (number == 7) return Element::float32;
    return number == 9 ? std::optional(Element::float64) : std::nullopt;
}

void take_matrix(Bytes from, Matrices& to) {
    constexpr std::uint32_t double_class = 6, single_class = 7, complex_flag = 0x800;
    std::uint32_t const flags = next_element(from).data.number();
    Bytes dims = next_element(from).data;
    Bytes letters = next_element(from).data;
    std::uint32_t const kind = flags & 0xFF;
    if ((kind != double_class && kind != single_class) || (flags & complex_flag) != 0) return;
    std::uint64_t n = 1;
    for (std::size_t axis = 0; !dims.empty(); ++axis) {
        std::uint32_t const extent = dims.number();
        if ((axis < 2 && extent != 4) || extent == 0 || extent > most_bytes) return;
        n *= extent;
        if (n > most_bytes) return;
    }
    Tagged const values = next_element(from); // in fewer bytes where they are whole numbers
    std::string const name(letters.take(letters.size()));
    if (auto const type = type_numbered(values.type); type && n >= 16)
        to[name] = elements(values.data, *type, static_cast<std::size_t>(n));
}

std::string inflated(std::string_view packed) {
    z_stream stream{};
    if (inflateInit(&stream) != Z_OK) throw NoMatlabFile();
    std::string result(std::min(most_bytes, 1024 + packed.size() * 1032), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream.avail_in = static_cast<uInt>(packed.size());
    stream.next_out = reinterpret_cast<Bytef*>(result.data());
    stream.avail_out = static_cast<uInt>(result.size());
    int const status = inflate(&stream, Z_FINISH);
    result.resize(stream.total_out);
    inflateEnd(&stream);
    if (status != Z_STREAM_END) throw NoMatlabFile();
    return result;
}

Matrices read_version_5(std::string_view all) {
    constexpr std::size_t head = 128;
    if (all.size() < head) throw NoMatlabFile();
    std::string_view const mark = all.substr(126, 2);
    if (mark != "IM" && mark != "MI") throw NoMatlabFile();
    Matrices result;
    for (Bytes file(all.substr(head), mark == "MI"); !file.empty();) {
        Tagged one = next_element(file);
        std::string unpacked;
        if (one.type == compressed_element) {
            unpacked = inflated(one.data.take(one.data.size()));
            Bytes inner(unpacked, file.big_endian());
            one = next_element(inner);
        }
        if (one.type == matrix_element) take_matrix(one.data, result);
    }
    return result;
}

/// Columns of the first matrix, x across reversed if it is not said which end of it is left; voxels from 0 on.
std::optional<Geometry> geometry_of(std::vector<double> const& m, bool reversed) {
    auto const column = [&](std::size_t c) {
        return Vec3{reversed ? -m[4 * c] : m[4 * c], m[4 * c + 1], m[4 * c + 2]};
    };
    for (std::size_t c = 0; c < 4; ++c)
        if (m[4 * c + 3] != (c == 3 ? 1 : 0)) return std::nullopt; // no affine map
    Geometry g;
    try {
        for (int axis = 0; axis < 3; ++axis) set_axis(g, axis, column(static_cast<std::size_t>(axis)), "");
        g.origin = column(0) + column(1) + column(2) + column(3) + Vec3{};
        check(g);
    } catch (Error const&) {
        return std::nullopt;
    }
    return g;
}

} // namespace

std::string spm_matrix_beside(std::string const& header) {
    std::string stem = header;
    if (lower_case(stem).ends_with(".gz")) stem.resize(stem.size() - 3);
    for (char const* const end : {".hdr", ".img"})
        if (lower_case(stem).ends_with(end)) stem.resize(stem.size() - 4);
    return stem + ".mat";
}

std::optional<SpmMatrix> read_spm_matrix(std::string const& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error) || std::filesystem::file_size(path, error) > most_bytes || error)
        return std::nullopt;
    std::ifstream file(path, std::ios::binary);
    std::string const all(std::istreambuf_iterator<char>(file), {});
    Matrices found;
    try {
        found = is_version_4(all) ? read_version_4(all) : read_version_5(all);
    } catch (NoMatlabFile const&) {
        return std::nullopt;
    }
    bool const sided = found.contains("mat");
    if (!sided && !found.contains("M")) return std::nullopt;
    std::vector<double> const& matrix = found[sided ? "mat" : "M"];
    auto const geometry = geometry_of(matrix, !sided);
    if (!geometry) return std::nullopt;
    SpmMatrix result{*geometry, sided};
    for (std::size_t i = 16; i < matrix.size(); ++i)
        result.others_differ = result.others_differ || matrix[i] != matrix[i % 16];
    return result;
}

std::string spm_matrix_bytes(Geometry const& g) {
    std::string bytes;
    auto const put = [&](std::uint64_t value, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) bytes += static_cast<char>(value >> (8 * i));
    };
    std::array<Vec3, 4> columns{};
    columns[3] = g.origin;
    for (int axis = 0; axis < 3; ++axis) {
        auto const a = static_cast<std::size_t>(axis);
        columns[a] = g.direction[a] * g.spacing[axis];
        columns[3] = columns[3] - columns[a];
    }
    for (bool const sided : {false, true}) {
        std::string const name = sided ? "mat" : "M";
        for (std::size_t const number :
             {std::size_t{0}, std::size_t{4}, std::size_t{4}, std::size_t{0}, name.size() + 1})
            put(number, 4);
        bytes += name + '\0';
        for (std::size_t c = 0; c < 4; ++c)
            for (int row = 0; row < 4; ++row) {
                double const value = row == 3 ? (c == 3 ? 1 : 0) : columns[c][row] * (row == 0 && !sided ? -1 : 1);
                put(std::bit_cast<std::uint64_t>(value + 0.0), 8);
            }
    }
    return bytes;
}

} // namespace vkt
