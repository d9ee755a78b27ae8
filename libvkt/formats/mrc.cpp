// MRC and CCP4 maps (https://www.ccpem.ac.uk/mrc_format/mrc2014.php): a header of 1024 bytes, an extended one, voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/slab_sink.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>

namespace vkt {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t size = 1024, labels_at = 224, label_length = 80, most_labels = 10;
constexpr std::int64_t most_extended = std::int64_t{1} << 30;
constexpr std::string_view ours = "VKT "; ///< type of the extended header that holds vkt's own as JSON
constexpr std::size_t most_history = std::size_t{256} << 10;
/// What a series found out about later needs in that header.
constexpr std::size_t growth = 256;
constexpr std::int64_t volume_stack = 401; ///< of space groups
constexpr std::string_view own_label = "written by vkt";

struct Mode {
    std::int64_t code;
    DataType type;
    std::int64_t components = 1; ///< real and imaginary parts, or red, green and blue
};
constexpr std::int64_t packed_mode = 101; ///< two voxels of four bits in a byte, which rows begin anew
constexpr Mode modes[] = {{0, DataType::int8},     {1, DataType::int16},      {2, DataType::float32},
                          {3, DataType::int16, 2}, {4, DataType::float32, 2}, {6, DataType::uint16},
                          {12, DataType::float16}, {16, DataType::uint8, 3}};

/// Words of four bytes by their number in the description, from 1.
class Words {
public:
    Words(std::span<std::byte const> bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

    std::int64_t integer(std::size_t word) const { return static_cast<std::int32_t>(bits(word)); }
    double real(std::size_t word) const { return static_cast<double>(std::bit_cast<float>(bits(word))); }
    Vec3 reals(std::size_t word) const { return {real(word), real(word + 1), real(word + 2)}; }
    bool big_endian() const { return big_endian_; }

private:
    std::uint32_t bits(std::size_t word) const {
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < 4; ++i)
            value = value << 8 | std::to_integer<std::uint32_t>(bytes_[(word - 1) * 4 + (big_endian_ ? i : 3 - i)]);
        return value;
    }

    std::span<std::byte const> bytes_;
    bool big_endian_;
};

bool plausible(Words const& w) {
    bool good = w.integer(4) >= 0 && w.integer(4) <= 101;
    for (std::size_t i = 1; i <= 3; ++i) good = good && w.integer(i) > 0;
    for (std::size_t i = 17; i <= 19; ++i) good = good && w.integer(i) >= 0 && w.integer(i) <= 3;
    return good;
}

/// The byte order is what makes sense of the header: stamps are wrong in known files.
std::optional<Words> words_in(std::span<std::byte const> head) {
    if (head.size() < size) return std::nullopt;
    for (bool const big : {false, true})
        if (Words const w(head, big); plausible(w)) return w;
    return std::nullopt;
}

/// Files of before 2000 have no mark; they are read by their names.
bool is_mrc(std::span<std::byte const> head) {
    return head.size() >= size && std::memcmp(head.data() + 208, "MAP", 3) == 0 && words_in(head);
}

/// Directions of the cell's edges: the first along x, the second in the plane of x and y.
std::array<Vec3, 3> edges(Vec3 angles) {
    std::array<Vec3, 3> result{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    bool right = true;
    for (int i = 0; i < 3; ++i) right = right && (angles[i] == 90 || !(angles[i] > 0 && angles[i] < 180));
    if (right) return result;
    auto const cosine = [&](int i) { return angles[i] == 90 ? 0.0 : std::cos(angles[i] * std::numbers::pi / 180); };
    double const sine = std::sqrt(1 - cosine(2) * cosine(2));
    double const y = (cosine(0) - cosine(1) * cosine(2)) / sine;
    double const rest = 1 - cosine(1) * cosine(1) - y * y;
    if (!(rest > 1e-6)) return result; // angles of no cell
    result[1] = {cosine(2), sine, 0};
    result[2] = {cosine(1), y, std::sqrt(rest)};
    return result;
}

void place(Header& header, Words const& w) {
    std::array<int, 3> axis{0, 1, 2}; // the edge of the cell along which columns, rows, sections run
    std::array<int, 3> said{};
    for (std::size_t i = 0; i < 3; ++i) said[i] = static_cast<int>(w.integer(17 + i)) - 1;
    std::array<int, 3> sorted = said;
    std::sort(sorted.begin(), sorted.end());
    if (sorted == axis) axis = said;
    Vec3 const cell = w.reals(11);
    std::array<Vec3, 3> const directions = edges(w.reals(14));
    Geometry& g = header.geometry;
    Vec3 start;
    for (std::size_t i = 0; i < 3; ++i) {
        int const own = static_cast<int>(i), edge = axis[i];
        double const samples = static_cast<double>(w.integer(8 + static_cast<std::size_t>(edge)));
        double const s = cell[edge] / samples;
        g.spacing[own] = samples > 0 && s > 0 && std::isfinite(s) ? s : 1;
        g.direction[i] = directions[static_cast<std::size_t>(edge)];
        start = start + g.direction[i] * (g.spacing[own] * static_cast<double>(w.integer(5 + i)));
    }
    Vec3 const origin = w.reals(50);
    bool const stated =
        std::isfinite(origin.x) && std::isfinite(origin.y) && std::isfinite(origin.z) && !(origin == Vec3{});
    g.origin = stated ? origin : start; // CCP4 counts voxels, and has other things in that place
    header.attributes["space units"] = "\"angstrom\" \"angstrom\" \"angstrom\"";
}

Mode mode_of(Words const& w, std::string const& name) {
    std::int64_t const code = w.integer(4);
    // IMOD's bytes are unsigned unless its flags say otherwise.
    if (code == 0 && w.integer(39) == 1146047817 && (w.integer(40) & 1) == 0) return {code, DataType::uint8};
    if (code == packed_mode) return {code, DataType::uint8};
    for (Mode const& m : modes)
        if (m.code == code) return m;
    throw Error(ErrorKind::data,
                text("'", name, "': mode ", code, " is unknown; modes 0 to 4, 6, 12, 16 and 101 are read"));
}

std::string bytes_of(Header const& header, std::int64_t volumes);

constexpr std::int64_t longest_extended = 64 << 20; ///< that is taken for one of ours

/// The extended header, if it is ours and the rest of the file is still what was written with it.
void read_extended(ByteSource& bytes, RawLayout& layout, std::span<std::byte const> head, std::int64_t length) {
    std::string_view const type(reinterpret_cast<char const*>(head.data()) + 104, 4);
    Header& header = layout.header;
    if (type != ours) {
        if (length > 0) header.attributes["mrc extended header"] = text(length, " bytes, not kept");
        return bytes.skip(length);
    }
    if (length > longest_extended)
        throw Error(ErrorKind::data, text("'", bytes.name(), "': its extended header exceeds 64 MiB"));
    std::string json(static_cast<std::size_t>(length), '\0');
    bytes.read_exactly(json.data(), json.size());
    json.resize(std::min(json.size(), json.find('\0')));
    try {
        Header kept = header_from_json(json);
        check(kept);
        bool same = kept.kind == Kind::structured && kept.dims == header.dims && kept.dtype == header.dtype;
        std::string const made = same ? bytes_of(kept, layout.volumes) : "";
        // Extents, cell and axes; space group; origin. Statistics and labels may be anybody's.
        for (auto const& [from, to] : {std::pair{0, 76}, std::pair{88, 92}, std::pair{196, 208}})
            same =
                same && std::memcmp(made.data() + from, head.data() + from, static_cast<std::size_t>(to - from)) == 0;
        if (same) {
            header = std::move(kept);
            header.dry_run = header.timing = false;
            if (auto const step = number_of(header, "sequence step"); step && layout.volumes > 1)
                layout.sequence = SequenceAxis{number_of(header, "sequence position").value_or(0), *step};
            return;
        }
        header.history = kept.history;
        header.values = kept.values;
        header.units = kept.units;
        header.error = VolumeError::lost("another program changed the header");
    } catch (Error const&) { // a damaged one is none
    }
}

RawLayout read_mrc_header(ByteSource& bytes) {
    std::string const name = bytes.name();
    std::vector<std::byte> head(size);
    bytes.read_exactly(head.data(), head.size());
    std::optional<Words> const w = words_in(head);
    if (!w) throw Error(ErrorKind::data, text("'", name, "' does not begin with the header of an MRC or CCP4 map"));
    RawLayout layout;
    layout.big_endian = w->big_endian();
    Mode const mode = mode_of(*w, name);
    layout.header.dtype = mode.type;
    layout.components.count = mode.components;
    layout.header.dims = {w->integer(1), w->integer(2), w->integer(3)};
    std::int64_t const group = w->integer(23), depth = w->integer(10);
    if (group >= volume_stack && group <= 630 && depth > 0 && layout.header.dims.z % depth == 0) {
        layout.volumes = layout.header.dims.z / depth;
        layout.header.dims.z = depth;
    } else if (group > 1 && group != volume_stack) {
        layout.header.attributes["space group"] = to_text(group);
    }
    place(layout.header, *w);
    std::int64_t const labels = std::clamp<std::int64_t>(w->integer(56), 0, most_labels);
    for (std::size_t i = 0; i < static_cast<std::size_t>(labels); ++i) {
        auto const* const begin = reinterpret_cast<char const*>(head.data()) + labels_at + i * label_length;
        std::string const label(trimmed(std::string_view(begin, ::strnlen(begin, label_length))));
        if (!label.empty() && label != own_label)
            layout.header.attributes[text("mrc label ", static_cast<std::int64_t>(i + 1))] = label;
    }
    std::int64_t const extended = w->integer(24);
    if (extended < 0 || extended > most_extended)
        throw Error(ErrorKind::data, text("'", name, "': an extended header of ", extended, " bytes"));
    read_extended(bytes, layout, head, extended);
    layout.header = in_utf8(std::move(layout.header));
    return layout;
}

/// A byte for each voxel of rows of `width` voxels, the lower four bits of a byte first.
std::unique_ptr<ByteSource> unpacked(std::unique_ptr<ByteSource> bytes, std::int64_t width) {
    std::string const name = bytes->name();
    std::shared_ptr<ByteSource> const source = std::move(bytes);
    constexpr std::size_t block = std::size_t{64} << 10;
    return std::make_unique<ByteSource>(name, [source, width, x = std::int64_t{0},
                                               packed = std::vector<std::byte>(block), held = std::vector<std::byte>(),
                                               at = std::size_t{0}](std::byte* to, std::size_t n) mutable {
        if (at == held.size()) {
            std::size_t const got = source->read(packed.data(), packed.size());
            held.clear();
            at = 0;
            for (std::size_t i = 0; i < got; ++i) {
                held.push_back(packed[i] & std::byte{15});
                if (++x < width) {
                    held.push_back(packed[i] >> 4);
                    ++x;
                }
                if (x >= width) x = 0;
            }
        }
        std::size_t const count = std::min(n, held.size() - at);
        if (count > 0) std::memcpy(to, held.data() + at, count);
        at += count;
        return count;
    });
}

std::unique_ptr<Source> open_mrc(std::unique_ptr<ByteSource> bytes, ReadOptions const&) {
    std::optional<Words> const head = words_in(bytes->peek(size));
    bool const packed = head && head->integer(4) == packed_mode;
    RawLayout layout = read_mrc_header(*bytes);
    if (packed) bytes = unpacked(std::move(bytes), layout.header.dims.x);
    return raw_source(std::move(bytes), std::move(layout));
}

/// Of the unit in which a volume's lengths are.
double angstroms(Header const& header) {
    auto const found = header.attributes.find("space units");
    auto const entries = found == header.attributes.end() ? std::nullopt : quoted_entries(found->second);
    if (!entries || entries->empty()) return 1;
    std::string const& unit = entries->front();
    return unit == "\"nm\"" ? 10 : unit == "\"um\"" ? 1e4 : unit == "\"mm\"" ? 1e7 : unit == "\"m\"" ? 1e10 : 1;
}

/// Which edge of the cell each axis runs along; none if the axes are turned or reversed.
std::optional<std::array<int, 3>> axis_order(Geometry const& g) {
    std::array<int, 3> order{};
    for (std::size_t i = 0; i < 3; ++i) {
        order[i] = -1;
        for (int edge = 0; edge < 3; ++edge)
            if (std::abs(g.direction[i][edge] - 1) < 1e-9) order[i] = edge;
        if (order[i] < 0) return std::nullopt;
    }
    return order;
}

std::string mrc_type_name(DataType type) {
    bool const known = std::any_of(std::begin(modes), std::end(modes),
                                   [&](Mode const& m) { return m.type == type && m.components == 1; });
    return known ? std::string(name_of(type)) : std::string();
}

/// The first 1024 bytes, without what follows them.
std::string bytes_of(Header const& header, std::int64_t volumes) {
    std::string bytes(size, '\0');
    auto const bits = [&](std::size_t word, std::uint32_t value) {
        for (std::size_t i = 0; i < 4; ++i) bytes[(word - 1) * 4 + i] = static_cast<char>(value >> (8 * i));
    };
    auto const integer = [&](std::size_t word, std::int64_t value) {
        if (value > INT32_MAX) throw Error(ErrorKind::usage, text("MRC cannot hold an extent of ", value));
        bits(word, static_cast<std::uint32_t>(value));
    };
    auto const real = [&](std::size_t word, double value) {
        bits(word, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    };
    Geometry const& g = header.geometry;
    auto const order = axis_order(g);
    std::array<int, 3> const edges_of_axes = order.value_or(std::array{0, 1, 2});
    double const unit = angstroms(header);
    for (std::size_t i = 0; i < 3; ++i) {
        int const own = static_cast<int>(i);
        auto const edge = static_cast<std::size_t>(edges_of_axes[i]);
        std::int64_t const n = header.dims[own];
        integer(1 + i, i == 2 ? n * volumes : n);
        integer(8 + edge, n);
        real(11 + edge, g.spacing[own] * static_cast<double>(n) * unit);
        real(14 + i, 90);
        integer(17 + i, edges_of_axes[i] + 1);
        real(50 + i, g.origin[own] * unit);
    }
    for (Mode const& m : modes)
        if (m.type == header.dtype && m.components == 1) integer(4, m.code);
    // Nobody has looked at the voxels: what the description has for statistics that are not known.
    real(20, 0), real(21, -1), real(22, -2), real(55, -1);
    integer(23, volumes > 1 ? volume_stack : header.dims.z > 1 ? 1 : 0);
    integer(28, 20141);
    std::copy_n("MAP ", 4, bytes.begin() + 208);
    bits(54, 0x4444);
    std::vector<std::string> labels{std::string(own_label)};
    if (!order) labels.emplace_back("axes are turned: the directions stand in the extended header alone");
    if (header.values != ValueMap{})
        labels.push_back(text("values are ", header.values.slope, " * voxel + ", header.values.intercept));
    if (header.history) {
        std::string const line = history_as_shell(*header.history);
        for (std::size_t at = 0; at < line.size() && labels.size() < most_labels; at += label_length)
            labels.push_back(one_line(line.substr(at, label_length)));
    }
    integer(56, std::ssize(labels));
    for (std::size_t i = 0; i < labels.size(); ++i) {
        labels[i].resize(label_length, ' ');
        std::copy(labels[i].begin(), labels[i].end(),
                  bytes.begin() + static_cast<std::ptrdiff_t>(labels_at + i * label_length));
    }
    return bytes;
}

/// Whether these bytes say all of the header, but for the last digits of its places. Programs that check files find
/// fault with extended headers of types that they do not know.
bool say_all(std::string const& bytes, Header const& header) {
    std::size_t at = 0;
    ByteSource source("MRC", [&](std::byte* to, std::size_t n) {
        std::size_t const got = std::min(n, bytes.size() - at);
        std::memcpy(to, bytes.data() + at, got);
        at += got;
        return got;
    });
    Header said = read_mrc_header(source).header;
    if (!same_geometry(said.geometry, header.geometry)) return false;
    said.geometry = header.geometry;
    if (!header.attributes.contains("space units")) said.attributes.erase("space units");
    mark_as_given(said); // as all files that say nothing of it
    return to_json(said) == to_json(header);
}

std::string mrc_bytes(HeaderText const& h) {
    std::string bytes = bytes_of(h.first, h.volumes);
    Header kept = h.first;
    kept.timing = kept.dry_run = false;
    if (kept.history) kept.history = parse_history(history_text(*kept.history, most_history));
    bool const exact = kept.error.exact() || kept.error.silent();
    if (h.length == size && !exact) // there is no place for it behind what was taken for plain
        throw Error(ErrorKind::usage, "one MRC file cannot hold volumes of which some are exact and others are not",
                    "write one file each: name it like out_%04d.mrc");
    if (h.length == size || (h.length == 0 && say_all(bytes, kept))) return bytes;
    std::copy(ours.begin(), ours.end(), bytes.begin() + 104);
    std::string json = to_json(kept);
    std::size_t const length = h.length > 0 ? h.length - size : (json.size() + growth) / 16 * 16;
    if (json.size() >= length) json.clear(); // has grown beyond its place
    json.resize(length, '\0');
    for (std::size_t i = 0; i < 4; ++i) bytes[92 + i] = static_cast<char>(length >> (8 * i));
    return bytes + json;
}

std::unique_ptr<Sink> create_mrc(std::string const& path, WriteOptions const& options) {
    HeaderFormat format{"MRC", ".mrc", "", "", "", DeflateWriter::Wrapper::gzip, false, mrc_type_name, mrc_bytes, true};
    return slab_sink(std::make_unique<HeaderAndVoxelsWriter>(std::move(format), path, options));
}

} // namespace

Format mrc_format() {
    return {"mrc", "MRC and CCP4 maps", {".mrc", ".mrcs", ".map", ".ccp4"}, is_mrc, open_mrc, create_mrc, true};
}

} // namespace vkt
