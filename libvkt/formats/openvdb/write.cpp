// The OpenVDB writer; part of the module openvdb.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/vdb_module.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/io/system_error.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Prune.h>
#pragma GCC diagnostic pop

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <type_traits>
#include <vector>

namespace vkt {

namespace {

template <class GridType, class T> class GridWriter {
public:
    using Value = typename GridType::ValueType;

    GridWriter(Volume const& volume, VdbWriteOptions const& options)
        : volume_(volume), tolerance_(options.prune.value_or(0)), background_(store_cell<Value>(options.background)),
          grid_(openvdb::StaticPtrCast<GridType>(openvdb::GridBase::createGrid(GridType::gridType()))) {
        // OpenVDB makes the grid: all that trees do in threads would be compiled once more with their constructor.
        grid_->tree().root().setBackground(background_, false);
    }

    typename GridType::Ptr build() {
        Index3 const logical = volume_.header().dims;
        auto const* const cells = reinterpret_cast<T const*>(volume_.buffer().read(Space::host));
        for (std::size_t b = 0; b < volume_.bricks().size(); ++b) {
            Brick const& brick = volume_.bricks()[b];
            T const* const from = cells + volume_.brick_offset(b);
            if (brick.level == 0)
                write_fine(brick, from);
            else
                write_coarse(brick, from, cell_width(logical, brick.level));
        }
        openvdb::tools::prune(grid_->tree(), store_cell<Value>(tolerance_));
        return grid_;
    }

private:
    static openvdb::Coord coordinate(Index3 at) {
        return {static_cast<int>(at.x), static_cast<int>(at.y), static_cast<int>(at.z)};
    }

    static Value value_of(T cell) {
        if constexpr (std::is_same_v<T, Half>)
            return static_cast<float>(cell);
        else
            return static_cast<Value>(cell);
    }

    /// NaN is kept: it is no background.
    bool kept(Value value) const {
        return !(std::abs(static_cast<double>(value) - static_cast<double>(background_)) <= tolerance_);
    }

    /// Leaf by leaf, so that each is looked up once.
    void write_fine(Brick const& brick, T const* from) {
        Box const box{brick.lower, brick.lower + brick.dims};
        auto const aligned = [](std::int64_t v) { return v & ~std::int64_t{7}; };
        Index3 at;
        for (at.z = aligned(box.lower.z); at.z < box.upper.z; at.z += 8)
            for (at.y = aligned(box.lower.y); at.y < box.upper.y; at.y += 8)
                for (at.x = aligned(box.lower.x); at.x < box.upper.x; at.x += 8)
                    write_leaf(brick, from, intersect(box, {at, at + Index3{8, 8, 8}}), at);
    }

    void write_leaf(Brick const& brick, T const* from, Box const& part, Index3 at) {
        typename GridType::TreeType::LeafNodeType* leaf = nullptr;
        for (std::int64_t z = part.lower.z; z < part.upper.z; ++z)
            for (std::int64_t y = part.lower.y; y < part.upper.y; ++y) {
                T const* const row =
                    from + ((z - brick.lower.z) * brick.dims.y + y - brick.lower.y) * brick.dims.x - brick.lower.x;
                for (std::int64_t x = part.lower.x; x < part.upper.x; ++x) {
                    Value const value = value_of(row[x]);
                    if (!kept(value)) continue;
                    if (leaf == nullptr) leaf = grid_->tree().touchLeaf(coordinate(at));
                    leaf->setValueOn(coordinate({x, y, z}), value);
                }
            }
    }

    void write_coarse(Brick const& brick, T const* from, Index3 w) {
        for (std::int64_t z = 0; z < brick.dims.z; ++z)
            for (std::int64_t y = 0; y < brick.dims.y; ++y)
                for (std::int64_t x = 0; x < brick.dims.x; ++x) {
                    Value const value = value_of(*from++);
                    if (!kept(value)) continue;
                    Index3 const low = brick.lower + Index3{x * w.x, y * w.y, z * w.z};
                    grid_->tree().fill({coordinate(low), coordinate(low + w - Index3{1, 1, 1})}, value, true);
                }
    }

    Volume const& volume_;
    double tolerance_;
    Value background_;
    typename GridType::Ptr grid_;
};

openvdb::GridBase::Ptr build(Volume const& volume, VdbWriteOptions const& options) {
    using namespace openvdb;
    switch (volume.header().dtype) {
    case DataType::uint8:
        return GridWriter<Int32Grid, std::uint8_t>(volume, options).build();
    case DataType::int8:
        return GridWriter<Int32Grid, std::int8_t>(volume, options).build();
    case DataType::uint16:
        return GridWriter<Int32Grid, std::uint16_t>(volume, options).build();
    case DataType::int16:
        return GridWriter<Int32Grid, std::int16_t>(volume, options).build();
    case DataType::int32:
        return GridWriter<Int32Grid, std::int32_t>(volume, options).build();
    case DataType::uint32:
        return GridWriter<Int64Grid, std::uint32_t>(volume, options).build();
    case DataType::int64:
        return GridWriter<Int64Grid, std::int64_t>(volume, options).build();
    case DataType::float16:
        return GridWriter<FloatGrid, Half>(volume, options).build();
    case DataType::float32:
        return GridWriter<FloatGrid, float>(volume, options).build();
    case DataType::float64:
        return GridWriter<DoubleGrid, double>(volume, options).build();
    case DataType::uint64:
        break;
    }
    throw Error(ErrorKind::usage, "OpenVDB has no grids of uint64", "convert first: vkt convert --dtype float64");
}

/// Eight bytes at a time into 64 bits of the hash.
class Mixer {
public:
    explicit Mixer(std::uint64_t seed) : state_(seed) {}
    void add(std::uint64_t word) {
        state_ = (state_ ^ word) * 0x9E3779B97F4A7C15U;
        state_ ^= state_ >> 29;
    }
    std::uint64_t value() const { return state_; }

private:
    std::uint64_t state_;
};

/// OpenVDB's class for files does not look whether what it writes arrives: on a full disk it ends as if all were well.
struct Archive : openvdb::io::Archive {
    using openvdb::io::Archive::write;
};

void write_file(openvdb::GridBase::Ptr const& grid, std::string const& path) {
    std::ofstream file(path, std::ios::binary);
    file.exceptions(std::ios::failbit | std::ios::badbit);
    Archive().write(file, openvdb::GridCPtrVec{grid}, true);
    file.close();
}

/// OpenVDB gives every file a random UUID. One that follows from the rest of the file makes equal volumes equal files.
void replace_uuid(std::string const& path) {
    constexpr std::streamoff place = 21; // behind the magic number, three version numbers and a flag
    constexpr std::size_t length = 36, block_size = std::size_t{1} << 20;
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    std::vector<char> block(block_size);
    Mixer low(1), high(2);
    std::uint64_t bytes = 0;
    while (file.read(block.data(), block_size), file.gcount() > 0) {
        auto const n = static_cast<std::size_t>(file.gcount());
        std::fill(block.begin() + file.gcount(), block.end(), '\0');
        if (bytes == 0) std::fill_n(block.begin() + place, length, '\0');
        for (std::size_t i = 0; i < n; i += 8) {
            std::uint64_t word = 0;
            std::memcpy(&word, block.data() + i, 8);
            low.add(word);
            high.add(word);
        }
        bytes += n;
    }
    low.add(bytes);
    high.add(bytes);
    std::array<char, length + 1> uuid{};
    // Version 8: made as its maker likes; variant 2.
    std::snprintf(uuid.data(), uuid.size(), "%08x-%04x-8%03x-%04x-%012llx", static_cast<unsigned>(low.value() >> 32),
                  static_cast<unsigned>(low.value() >> 16 & 0xFFFFU), static_cast<unsigned>(low.value() & 0xFFFU),
                  static_cast<unsigned>(high.value() >> 48 & 0x3FFFU) | 0x8000U,
                  static_cast<unsigned long long>(high.value() & 0xFFFFFFFFFFFFU));
    file.clear();
    file.exceptions(std::ios::failbit | std::ios::badbit);
    file.seekp(place);
    file.write(uuid.data(), static_cast<std::streamsize>(length));
    file.close();
}

template <class T> bool put_as(openvdb::MetaMap& grid, std::string const& name, std::string const& value) {
    std::vector<double> numbers;
    for (auto const& word : words_of(value))
        if (auto const number = number_in(word)) numbers.push_back(*number);
    if constexpr (std::is_same_v<T, bool>) {
        if (value != "true" && value != "false") return false;
        grid.insertMeta(name, openvdb::BoolMetadata(value == "true"));
    } else if constexpr (std::is_integral_v<T>) {
        auto const number = integer_in(value);
        if (!number || *number != static_cast<T>(*number)) return false;
        grid.insertMeta(name, openvdb::TypedMetadata<T>(static_cast<T>(*number)));
    } else if constexpr (std::is_floating_point_v<T>) {
        if (numbers.size() != 1) return false;
        grid.insertMeta(name, openvdb::TypedMetadata<T>(static_cast<T>(numbers[0])));
    } else {
        using E = typename T::value_type;
        auto const holds = [](double number) {
            return !std::is_integral_v<E> || (std::trunc(number) == number && std::abs(number) < 0x1p31);
        };
        if (numbers.size() != 3 || !std::all_of(numbers.begin(), numbers.end(), holds)) return false;
        auto const element = [&](std::size_t i) { return static_cast<E>(numbers[i]); };
        grid.insertMeta(name, openvdb::TypedMetadata<T>(T(element(0), element(1), element(2))));
    }
    return true;
}

/// As the type of that name if the value still is one.
bool put_typed(openvdb::MetaMap& grid, std::string const& type, std::string const& name, std::string const& value) {
    if (type == "bool") return put_as<bool>(grid, name, value);
    if (type == "int32") return put_as<std::int32_t>(grid, name, value);
    if (type == "int64") return put_as<std::int64_t>(grid, name, value);
    if (type == "float") return put_as<float>(grid, name, value);
    if (type == "double") return put_as<double>(grid, name, value);
    if (type == "vec3i") return put_as<openvdb::Vec3i>(grid, name, value);
    if (type == "vec3s") return put_as<openvdb::Vec3s>(grid, name, value);
    if (type == "vec3d") return put_as<openvdb::Vec3d>(grid, name, value);
    return false;
}

/// Moves attributes to metadata, where other programs find them; those that are not the user's stay.
void write_attributes(std::map<std::string, std::string>& attributes, openvdb::MetaMap& grid) {
    std::map<std::string, std::string> types, own;
    if (auto const found = attributes.find(types_name); found != attributes.end())
        types = parse_attributes(found->second);
    for (auto const& [name, value] : attributes) {
        if (name == types_name) continue; // the metadata say it
        if (name.empty() || is_own_metadata(name))
            own.emplace(name, value);
        else if (auto const type = types.find(name); type == types.end() || !put_typed(grid, type->second, name, value))
            grid.insertMeta(name, openvdb::StringMetadata(value));
    }
    attributes = std::move(own);
}

} // namespace

namespace openvdb_module {

void write(Volume const& volume, std::string const& path, VdbWriteOptions const& options) {
    Header const& header = volume.header();
    std::string const& shown = options.shown.empty() ? path : options.shown;
    for (int a = 0; a < 3; ++a)
        if (header.dims[a] > std::numeric_limits<int>::max())
            throw Error(ErrorKind::usage, text("OpenVDB counts voxels up to 2^31, not ", header.dims));
    if (options.prune && !(*options.prune >= 0))
        throw Error(ErrorKind::usage, "--prune takes a tolerance that is not negative");
    openvdb::initialize();
    try {
        openvdb::GridBase::Ptr const grid = build(volume, options);
        openvdb::Mat4R matrix = openvdb::Mat4R::identity(); // row vectors: world = index * matrix
        for (int a = 0; a < 3; ++a)
            for (int w = 0; w < 3; ++w)
                matrix[a][w] = header.geometry.spacing[a] * header.geometry.direction[static_cast<std::size_t>(a)][w];
        for (int w = 0; w < 3; ++w) matrix[3][w] = header.geometry.origin[w];
        grid->setTransform(openvdb::math::Transform::createLinearTransform(matrix));
        grid->setName(options.name);
        if (!options.grid_class.empty()) grid->setGridClass(openvdb::GridBase::stringToGridClass(options.grid_class));
        grid->setSaveFloatAsHalf(header.dtype == DataType::float16);
        // What lies outside the active voxels would be lost otherwise, and what was cut off would be back.
        Box const region = region_of(header);
        auto const corner = [](Index3 p) {
            return openvdb::Vec3IMetadata(
                openvdb::Vec3i(static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z)));
        };
        grid->insertMeta(box_min_name, corner(region.lower));
        grid->insertMeta(box_max_name, corner(region.upper - Index3{1, 1, 1}));
        Header kept = in_utf8(header);
        kept.timing = false;
        if (options.prune && kept.error.known()) {
            // A value becomes the background's, or that of the nodes around it, level by level.
            constexpr double steps = 4;
            if (*options.prune > 0 && kept.error.exact()) kept.error.kind = Certainty::bound;
            kept.error.at_most += steps * *options.prune * std::abs(kept.values.slope);
        }
        write_attributes(kept.attributes, *grid);
        grid->insertMeta(header_name, openvdb::StringMetadata(to_json(kept)));
        write_file(grid, path);
        replace_uuid(path);
    } catch (Error const&) {
        throw;
    } catch (std::bad_alloc const&) {
        throw Error(ErrorKind::resources, text("not enough memory to write '", shown, "'"));
    } catch (std::ios::failure const&) { // the stream does not say why, and the last thing that failed was its writing
        throw system_error(text("cannot write '", shown, "'"));
    } catch (std::exception const& error) {
        throw Error(ErrorKind::io, text("cannot write '", shown, "': ", error.what()));
    }
}

} // namespace openvdb_module

namespace {
VdbFunctions const functions{openvdb_module::write};
ParserHandler parse(std::string const& path) { return answer_about(openvdb_module::open(path)); }
} // namespace

} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_openvdb;
vkt::ModuleExport const vkt_module_openvdb{VKT_VERSION, &vkt::functions, &vkt::parse};
}
