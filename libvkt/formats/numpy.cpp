// NumPy arrays (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html).
// SPDX-License-Identifier: MIT
#include "libvkt/formats/numpy.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/slab_sink.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <utility>

namespace vkt {

namespace {

using namespace std::string_view_literals;

constexpr std::string_view magic = "\x93NUMPY"sv;
constexpr std::size_t largest_header = std::size_t{1} << 20;
constexpr std::size_t alignment = 64;
/// What a series found out about later needs: a number of volumes, a comma and a blank.
constexpr std::size_t growth = 22;

struct TypeName {
    char const* name; ///< without byte order
    DataType type;
};

constexpr TypeName type_names[] = {
    {"u1", DataType::uint8},   {"i1", DataType::int8},    {"u2", DataType::uint16},  {"i2", DataType::int16},
    {"u4", DataType::uint32},  {"i4", DataType::int32},   {"u8", DataType::uint64},  {"i8", DataType::int64},
    {"f2", DataType::float16}, {"f4", DataType::float32}, {"f8", DataType::float64}, {"b1", DataType::uint8},
};

/// The few kinds of Python literals that headers have.
class Dictionary {
public:
    Dictionary(std::string const& name, std::string_view rest) : name_(name), rest_(rest) {}

    void parse();
    std::string descr;
    std::optional<bool> fortran;
    std::optional<std::vector<std::int64_t>> shape;

private:
    [[noreturn]] void fail(std::string const& what) const {
        throw Error(ErrorKind::data, text("'", name_, "': ", what));
    }
    bool take(char c) {
        rest_ = trimmed(rest_);
        if (rest_.empty() || rest_.front() != c) return false;
        rest_.remove_prefix(1);
        return true;
    }
    void need(char c) {
        if (!take(c)) fail(text("'", std::string(1, c), "' is missing in its header"));
    }
    std::string string();
    bool boolean();
    std::vector<std::int64_t> tuple();

    std::string const& name_;
    std::string_view rest_;
};

std::string Dictionary::string() {
    rest_ = trimmed(rest_);
    if (rest_.starts_with('[')) fail("its elements are structures; a volume has one number in each voxel");
    if (rest_.empty() || (rest_.front() != '\'' && rest_.front() != '"'))
        fail("its header has no string where one belongs");
    std::size_t const end = rest_.find(rest_.front(), 1);
    if (end == std::string_view::npos) fail("a string in its header does not end");
    std::string result(rest_.substr(1, end - 1));
    rest_.remove_prefix(end + 1);
    return result;
}

bool Dictionary::boolean() {
    rest_ = trimmed(rest_);
    for (bool const value : {false, true}) {
        std::string_view const word = value ? "True" : "False";
        if (!rest_.starts_with(word)) continue;
        rest_.remove_prefix(word.size());
        return value;
    }
    fail("fortran_order is neither True nor False");
}

std::vector<std::int64_t> Dictionary::tuple() {
    std::vector<std::int64_t> result;
    need('(');
    while (!take(')')) {
        rest_ = trimmed(rest_);
        std::size_t const end = std::min(rest_.find_first_not_of("0123456789"), rest_.size());
        auto const number = integer_in(rest_.substr(0, end));
        if (!number || result.size() > 32) fail("its shape is no tuple of numbers");
        result.push_back(*number);
        rest_.remove_prefix(end);
        take('L'); // of Python 2
        if (!take(',')) {
            need(')');
            break;
        }
    }
    return result;
}

void Dictionary::parse() {
    need('{');
    while (!take('}')) {
        std::string const key = string();
        need(':');
        if (key == "descr")
            descr = string();
        else if (key == "fortran_order")
            fortran = boolean();
        else if (key == "shape")
            shape = tuple();
        else
            fail(text("'", key.substr(0, 40), "' is no key of a NumPy header"));
        if (!take(',')) {
            need('}');
            break;
        }
    }
    if (descr.empty() || !fortran || !shape) fail("its header lacks descr, fortran_order or shape");
}

void read_type(RawLayout& layout, std::string const& descr, std::string const& name) {
    char const order = descr.front();
    // Complex numbers are their real and imaginary parts.
    std::string word = descr.substr(1);
    if (word == "c8" || word == "c16") {
        layout.components.count = 2;
        word = word == "c8" ? "f4" : "f8";
    }
    for (auto const& entry : type_names)
        if (word == entry.name && (order == '<' || order == '>' || order == '|' || order == '=')) {
            layout.header.dtype = entry.type;
            layout.big_endian = order == '>';
            if (size_of(entry.type) > 1 && order == '|') break;
            return;
        }
    throw Error(ErrorKind::data,
                text("'", name, "': elements of type '", descr.substr(0, 40), "', which volumes do not have"),
                "in Python: numpy.save(name, array.astype(\"float32\"))");
}

void read_shape(RawLayout& layout, std::vector<std::int64_t> shape, bool fortran, std::string const& name) {
    if (!fortran) std::reverse(shape.begin(), shape.end());
    while (shape.size() > 4 && shape.back() == 1) shape.pop_back(); // batches of one
    if (shape.empty() || shape.size() > 4)
        throw Error(ErrorKind::data, text("'", name, "': an array of ", std::ssize(shape),
                                          " dimensions; one to three make a volume, four a series"));
    for (std::size_t i = 0; i < shape.size(); ++i) {
        if (shape[i] < 1 || shape[i] > max_extent)
            throw Error(ErrorKind::data, text("'", name, "': an extent of ", shape[i], " is not between 1 and 2^40"));
        if (i < 3)
            layout.header.dims[static_cast<int>(i)] = shape[i];
        else
            layout.volumes = shape[i];
    }
}

bool is_numpy(std::span<std::byte const> head) {
    return head.size() >= magic.size() && std::memcmp(head.data(), magic.data(), magic.size()) == 0;
}

std::unique_ptr<Source> open_numpy(std::unique_ptr<ByteSource> bytes, ReadOptions const&) {
    RawLayout layout = read_numpy_header(*bytes);
    return raw_source(std::move(bytes), std::move(layout));
}

std::unique_ptr<Sink> create_numpy(std::string const& path, WriteOptions const& options) {
    HeaderFormat format{"NumPy", ".npy", "", "", "", DeflateWriter::Wrapper::gzip, false, numpy_type_name, numpy_bytes};
    return slab_sink(std::make_unique<HeaderAndVoxelsWriter>(std::move(format), path, options));
}

} // namespace

RawLayout read_numpy_header(ByteSource& bytes) {
    std::array<unsigned char, 12> start{};
    if (!is_numpy(bytes.peek(magic.size())))
        throw Error(ErrorKind::data, text("'", bytes.name(), "' does not begin as a NumPy array does"));
    bytes.read_exactly(start.data(), 8);
    unsigned const version = start[6];
    if (version < 1 || version > 3)
        throw Error(ErrorKind::data,
                    text("'", bytes.name(), "': version ", static_cast<int>(version), " of .npy is unknown"));
    std::size_t const digits = version == 1 ? 2 : 4;
    bytes.read_exactly(start.data() + 8, digits);
    std::size_t length = 0;
    for (std::size_t i = digits; i-- > 0;) length = length << 8 | start[8 + i];
    if (length > largest_header) throw Error(ErrorKind::data, text("'", bytes.name(), "': its header exceeds 1 MiB"));
    std::string header(length, '\0');
    bytes.read_exactly(header.data(), length);
    Dictionary dictionary(bytes.name(), header);
    dictionary.parse();
    RawLayout layout;
    read_type(layout, dictionary.descr, bytes.name());
    read_shape(layout, *dictionary.shape, *dictionary.fortran, bytes.name());
    return layout;
}

std::string numpy_bytes(HeaderText const& h) {
    Index3 const& d = h.first.dims;
    std::string header = text("{'descr': '", numpy_type_name(h.first.dtype), "', 'fortran_order': False, 'shape': (",
                              h.volumes > 1 ? text(h.volumes, ", ") : "", d.z, ", ", d.y, ", ", d.x, "), }");
    std::size_t const start = magic.size() + 4;
    std::size_t const length =
        h.length > 0 ? h.length : (start + header.size() + growth + 1 + alignment - 1) / alignment * alignment;
    header.resize(length - start - 1, ' ');
    std::string result(magic);
    result += "\1\0"sv;
    result += static_cast<char>(length - start);
    result += static_cast<char>((length - start) >> 8);
    return result + header + "\n";
}

std::string numpy_type_name(DataType type) {
    for (auto const& entry : type_names)
        if (entry.type == type) return text(size_of(type) == 1 ? "|" : "<", entry.name);
    return {};
}

Format numpy_format() { return {"numpy", "NumPy arrays", {".npy"}, is_numpy, open_numpy, create_numpy, true}; }

} // namespace vkt
