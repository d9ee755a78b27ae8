// The OpenVDB reader; part of the module openvdb.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/vdb_module.h"

#include "libvkt/core/error.h"
#include "libvkt/core/half.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <cerrno>
#include <cstring>
#include <unistd.h>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <openvdb/io/Archive.h>
#include <openvdb/io/File.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>
#pragma GCC diagnostic pop

#include <filesystem>
#include <fstream>
#include <map>
#include <type_traits>

namespace vkt {

namespace {

struct Kinds {
    char const* tree; ///< beginning of OpenVDB's type name
    DataType dtype;
};

constexpr Kinds scalar_kinds[] = {{"Tree_float_", DataType::float32}, {"Tree_double_", DataType::float64},
                                  {"Tree_int32_", DataType::int32},   {"Tree_int64_", DataType::int64},
                                  {"Tree_bool_", DataType::uint8},    {"Tree_mask_", DataType::uint8}};

std::optional<DataType> dtype_of(openvdb::GridBase const& grid) {
    for (auto const& kind : scalar_kinds)
        if (grid.type().rfind(kind.tree, 0) == 0)
            return kind.dtype == DataType::float32 && grid.saveFloatAsHalf() ? DataType::float16 : kind.dtype;
    return std::nullopt;
}

/// Walks the table of grids. OpenVDB itself does not look whether the stream ended: on a truncated file it goes on with
/// arbitrary sizes, for minutes or until memory ends.
class WholenessCheck : openvdb::io::Archive {
public:
    static void run(std::string const& path) {
        WholenessCheck archive;
        std::ifstream file(path, std::ios::binary);
        file.exceptions(std::ios::eofbit | std::ios::failbit | std::ios::badbit);
        auto const size = static_cast<std::int64_t>(std::filesystem::file_size(path));
        archive.readHeader(file);
        openvdb::io::setVersion(file, archive.libraryVersion(), archive.fileVersion());
        openvdb::MetaMap().readMeta(file);
        if (!archive.inputHasGridOffsets()) return; // written to a stream: nothing states where grids end
        std::int32_t const count = openvdb::io::Archive::readGridCount(file);
        for (std::int32_t i = 0; i < count; ++i) {
            openvdb::io::GridDescriptor descriptor;
            std::streamoff const begin = file.tellg();
            descriptor.read(file);
            if (descriptor.getEndPos() <= begin) // it would be read again and again
                throw Error(ErrorKind::data, text(path, ": the table of grids goes in circles"));
            if (descriptor.getGridPos() < 0 || descriptor.getGridPos() > descriptor.getEndPos() ||
                descriptor.getEndPos() > size)
                throw Error(ErrorKind::data,
                            text(path, ": ended early: grid '", openvdb::Name(descriptor.gridName()), "' ends at byte ",
                                 static_cast<std::int64_t>(descriptor.getEndPos()), ", the file at ", size));
            file.seekg(descriptor.getEndPos());
        }
    }
};

Geometry geometry_of(openvdb::math::Transform const& transform, std::string const& path, openvdb::Coord first) {
    if (!transform.isLinear())
        throw Error(ErrorKind::data, text(path, ": the grid's transform is not linear (frustum)"));
    Geometry geometry;
    openvdb::Vec3d const origin = transform.indexToWorld(openvdb::Vec3d(first.x(), first.y(), first.z()));
    for (int a = 0; a < 3; ++a) {
        openvdb::Vec3d unit(0, 0, 0);
        unit[a] = 1;
        openvdb::Vec3d const step = transform.indexToWorld(unit) - transform.indexToWorld(openvdb::Vec3d(0, 0, 0));
        geometry.origin[a] = origin[a];
        geometry.spacing[a] = step.length();
        auto const axis = static_cast<std::size_t>(a);
        for (int w = 0; w < 3; ++w) geometry.direction[axis][w] = step[w] / geometry.spacing[a];
    }
    check(geometry);
    return geometry;
}

/// An open file; OpenVDB's exceptions become ours.
class VdbFile {
public:
    explicit VdbFile(std::string const& path) : path_(path), file_(path) {
        if (access(path.c_str(), R_OK) != 0)
            throw Error(ErrorKind::io, text("cannot read ", path, ": ", std::strerror(errno)));
        guarded([&] {
            WholenessCheck::run(path);
            file_.open(false);
        });
    }

    AmrListing list() {
        AmrListing listing;
        listing.format = "OpenVDB";
        guarded([&] {
            openvdb::CoordBBox all;
            openvdb::math::Transform::ConstPtr shared;
            for (auto name = file_.beginName(); name != file_.endName(); ++name) {
                openvdb::GridBase::Ptr const grid = file_.readGridMetadata(name.gridName());
                auto const dtype = dtype_of(*grid);
                if (!dtype) {
                    listing.not_read.push_back(text("grid '", name.gridName(), "' of type ", grid->valueType()));
                    continue;
                }
                openvdb::CoordBBox const box = active_box(*grid);
                listing.variables.push_back({name.gridName(), *dtype, {}, {}, extent_text(*grid, box)});
                // Grids that lie on one lattice share an extent; of others the header is that of the first.
                if (box.empty() || !grid->transform().isLinear() || (shared && *shared != grid->transform())) continue;
                shared = grid->transformPtr();
                all.expand(box);
            }
            if (shared) {
                for (int a = 0; a < 3; ++a)
                    listing.header.dims[a] = std::int64_t{all.max()[a]} - std::int64_t{all.min()[a]} + 1;
                listing.header.geometry = geometry_of(*shared, path_, all.min());
            }
        });
        return listing;
    }

    openvdb::GridBase::Ptr grid(std::string const& wanted) {
        AmrListing const listing = list();
        std::vector<AmrVariable> const& variables = listing.variables;
        std::string name = wanted;
        guarded([&] {
            if (!wanted.empty() && file_.hasGrid(wanted) && !dtype_of(*file_.readGridMetadata(wanted)))
                refuse_kind(wanted, file_.readGridMetadata(wanted)->type());
            if (variables.empty() && file_.beginName() != file_.endName()) {
                auto const first = file_.beginName();
                refuse_kind(first.gridName(), file_.readGridMetadata(first.gridName())->type());
            }
        });
        name = variables[choose_variable(variables, wanted, path_)].name;
        openvdb::GridBase::Ptr result;
        guarded([&] {
            result = file_.readGrid(name);
            // What is said of the whole file is said of the grid, too.
            openvdb::MetaMap::Ptr const common = file_.getMetadata();
            for (auto meta = common->beginMeta(); common && meta != common->endMeta(); ++meta)
                if (meta->second && !(*result)[meta->first]) result->insertMeta(meta->first, *meta->second);
        });
        return result;
    }

private:
    /// The box of the active voxels, as the writer stated it: grids need not be read for that.
    static openvdb::CoordBBox active_box(openvdb::GridBase const& grid) {
        auto const low = grid.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MIN);
        auto const high = grid.getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MAX);
        if (!low || !high) return {};
        return {openvdb::Coord(low->value()), openvdb::Coord(high->value())};
    }

    static std::string extent_text(openvdb::GridBase const& grid, openvdb::CoordBBox const& box) {
        auto const count = grid.getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT);
        std::string active = count ? text(std::int64_t{count->value()}, " active voxels") : std::string();
        if (box.empty()) return active;
        std::int64_t const one = 1;
        Index3 const n{one + box.max().x() - box.min().x(), one + box.max().y() - box.min().y(),
                       one + box.max().z() - box.min().z()};
        return text(active, active.empty() ? "" : " in ", n, " from ", box.min().x(), " ", box.min().y(), " ",
                    box.min().z());
    }

    template <class Function> void guarded(Function function) {
        try {
            function();
        } catch (Error const&) {
            throw;
        } catch (std::bad_alloc const&) {
            throw; // the limits of this process are known to whoever runs it
        } catch (std::exception const& error) {
            throw Error(ErrorKind::data, text(path_, ": ", error.what()));
        }
    }

    [[noreturn]] void refuse_kind(std::string const& name, std::string const& type) const {
        bool const points = type.find("ptdata") != std::string::npos || type.find("ptidx") != std::string::npos;
        throw Error(ErrorKind::data,
                    text(path_, ": grid '", name, "' holds ", points ? "points" : text("no scalars (", type, ")")),
                    points ? "rasterize the points to a scalar grid first" : "");
    }

    std::string path_;
    openvdb::io::File file_;
};

template <class T> std::optional<std::string> value_text(openvdb::Metadata const& meta) {
    if (meta.typeName() != openvdb::TypedMetadata<T>::staticTypeName()) return std::nullopt;
    T const& value = static_cast<openvdb::TypedMetadata<T> const&>(meta).value();
    if constexpr (std::is_same_v<T, bool>)
        return std::string(value ? "true" : "false");
    else if constexpr (std::is_arithmetic_v<T>)
        return to_text(value);
    else
        return text(value[0], " ", value[1], " ", value[2]);
}

/// Numbers that read back to the same value; nullopt for types that vkt cannot write again.
std::optional<std::string> number_text(openvdb::Metadata const& meta) {
    for (auto const function :
         {value_text<bool>, value_text<std::int32_t>, value_text<std::int64_t>, value_text<float>, value_text<double>,
          value_text<openvdb::Vec3i>, value_text<openvdb::Vec3s>, value_text<openvdb::Vec3d>})
        if (auto result = function(meta)) return result;
    return std::nullopt;
}

/// What others have to say about the grid.
void read_metadata(openvdb::MetaMap const& grid, std::map<std::string, std::string>& attributes) {
    std::map<std::string, std::string> types;
    for (auto meta = grid.beginMeta(); meta != grid.endMeta(); ++meta) {
        if (!meta->second || is_own_metadata(meta->first)) continue;
        auto const number = number_text(*meta->second);
        attributes[meta->first] = number ? *number : meta->second->str();
        if (number) types.emplace(meta->first, meta->second->typeName());
    }
    if (!types.empty()) attributes[types_name] = attributes_text(types);
}

/// A leaf node or tile on its way to a brick; coordinates are OpenVDB's.
struct Node {
    openvdb::Coord lower;
    std::int64_t cells; ///< along an axis
    int level;
};

/// A cell's value in the volume's type; half voxels were widened by OpenVDB and narrow exactly.
template <class T, class V> T cell_of(V const& value) {
    if constexpr (std::is_same_v<T, Half>)
        return Half(static_cast<float>(value));
    else
        return static_cast<T>(value);
}

template <class GridType, class T> class GridReader : public std::enable_shared_from_this<GridReader<GridType, T>> {
public:
    /// `owner` keeps the grid.
    GridReader(GridType const& grid, openvdb::GridBase::ConstPtr owner, std::string const& path, DataType dtype)
        : grid_(grid), owner_(std::move(owner)), path_(path) {
        header_.kind = Kind::hierarchical;
        header_.dtype = dtype;
        mark_as_given(header_);
    }

    ParsedTree read(AmrReadOptions const& options) {
        collect();
        describe();
        header_ = in_utf8(std::move(header_));
        std::optional<Box> const region = wanted_box(options, header_);
        if (region) header_.attributes["roi"] = to_text(*region);
        std::vector<Brick> bricks;
        std::vector<std::size_t> kept;
        auto const point = [](Index3 p) {
            return Vec3{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
        };
        for (std::size_t i = 0; i < nodes_.size(); ++i) {
            Node const& node = nodes_[i];
            openvdb::Coord const at = node.lower - first_;
            Brick const brick{{at.x(), at.y(), at.z()}, {node.cells, node.cells, node.cells}, node.level};
            if (region && !domain_meets(brick, header_.dims, point(region->lower), point(region->upper))) continue;
            bricks.push_back(brick);
            kept.push_back(i);
        }
        if (bricks.empty()) throw Error(ErrorKind::usage, text(path_, ": the region meets no node of the grid"));
        auto const cells = [reader = this->shared_from_this(),
                            kept = std::move(kept)](std::size_t first, std::size_t count, std::byte* to) {
            auto* next = reinterpret_cast<T*>(to);
            for (std::size_t i = first; i < first + count; ++i) {
                Node const& node = reader->nodes_[kept[i]];
                reader->fill(node, next);
                next += node.cells * node.cells * node.cells;
            }
        };
        return {header_, std::move(bricks), {}, cells};
    }

private:
    void add(openvdb::Coord lower, std::int64_t extent, std::int64_t cells, int level) {
        nodes_.push_back({lower, cells, level});
        for (int a = 0; a < 3; ++a) {
            std::int64_t const low = lower[a], high = low + extent;
            low_[a] = nodes_.size() == 1 ? low : std::min(low_[a], low);
            high_[a] = nodes_.size() == 1 ? high : std::max(high_[a], high);
        }
    }

    void collect() {
        auto const& tree = grid_.tree();
        for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) add(leaf->origin(), 8, 8, 0);
        auto tile = tree.cbeginValueAll();
        tile.setMaxDepth(GridType::TreeType::ValueAllCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            if (!tile.isValueOn() && tile.getValue() == tree.background()) continue;
            openvdb::CoordBBox box;
            tile.getBoundingBox(box);
            std::int64_t const extent = std::int64_t{box.max().x()} - box.min().x() + 1;
            // Cells much larger than their neighbours would blur far into them; memory forbids small ones in large
            // tiles.
            int const level = extent > 128 ? 7 : 3;
            add(box.min(), extent, extent >> level, level);
        }
        // All of a volume may be background: one cell says so. Of a grid without extent nothing is known.
        auto const low = grid_.template getMetadata<openvdb::Vec3IMetadata>(box_min_name);
        if (nodes_.empty() && low) add(openvdb::Coord(low->value()) & ~7, 8, 1, 3);
        if (nodes_.empty()) throw Error(ErrorKind::data, text(path_, ": grid '", grid_.getName(), "' is empty"));
    }

    /// The volume's own extent where the writer said it, otherwise that of the active voxels; empty if there are none.
    std::optional<Box> extent() const {
        auto const low = grid_.template getMetadata<openvdb::Vec3IMetadata>(box_min_name);
        auto const high = grid_.template getMetadata<openvdb::Vec3IMetadata>(box_max_name);
        openvdb::CoordBBox box = grid_.evalActiveVoxelBoundingBox();
        if (low && high) {
            box = openvdb::CoordBBox(openvdb::Coord(low->value()), openvdb::Coord(high->value()));
            if (box.empty()) throw Error(ErrorKind::data, text(path_, ": the volume's box is empty"));
        }
        if (box.empty()) return std::nullopt;
        Box result;
        for (int a = 0; a < 3; ++a) {
            result.lower[a] = box.min()[a];
            result.upper[a] = std::int64_t{box.max()[a]} + 1;
        }
        return result;
    }

    void describe() {
        std::optional<Box> box = extent();
        for (int a = 0; box && a < 3; ++a) {
            low_[a] = std::min(low_[a], box->lower[a]);
            high_[a] = std::max(high_[a], box->upper[a]);
        }
        header_.dims = high_ - low_;
        first_ = openvdb::Coord(static_cast<int>(low_.x), static_cast<int>(low_.y), static_cast<int>(low_.z));
        header_.geometry = geometry_of(grid_.transform(), path_, first_);
        auto& attributes = header_.attributes;
        if (auto const text = grid_.template getMetadata<openvdb::StringMetadata>(header_name)) {
            Header kept = header_from_json(text->value());
            header_.values = kept.values;
            header_.units = std::move(kept.units);
            header_.history = std::move(kept.history);
            header_.error = std::move(kept.error);
            mark_as_given(header_);
            attributes = std::move(kept.attributes);
            for (char const* own : {"class", "roi"}) attributes.erase(own); // the grid itself says them
        }
        read_metadata(grid_, attributes);
        attributes["variable"] = grid_.getName();
        attributes["background"] = to_text(header_.values.physical(static_cast<double>(grid_.background())));
        if (grid_.getGridClass() != openvdb::GRID_UNKNOWN)
            attributes["class"] = openvdb::GridBase::gridClassToString(grid_.getGridClass());
        if (!box) return;
        Box const region{box->lower - low_, box->upper - low_};
        if (!(region == box_of(header_.dims))) attributes["roi"] = to_text(region);
    }

    void fill(Node const& node, T* to) const {
        if (node.level == 0) {
            auto const* const leaf = grid_.tree().probeConstLeaf(node.lower);
            for (openvdb::Index z = 0; z < 8; ++z) // OpenVDB's leaves run fastest along z
                for (openvdb::Index y = 0; y < 8; ++y)
                    for (openvdb::Index x = 0; x < 8; ++x) *to++ = cell_of<T>(leaf->getValue(x << 6 | y << 3 | z));
            return;
        }
        T const value = cell_of<T>(grid_.tree().getValue(node.lower));
        std::fill_n(to, node.cells * node.cells * node.cells, value);
    }

    GridType const& grid_;
    openvdb::GridBase::ConstPtr owner_;
    std::string path_;
    Header header_;
    std::vector<Node> nodes_;
    Index3 low_, high_;
    openvdb::Coord first_;
};

template <class GridType, class T>
std::optional<ParsedTree> read_as(openvdb::GridBase::ConstPtr const& grid, std::string const& path,
                                  AmrReadOptions const& options, DataType dtype) {
    if (!grid->isType<GridType>()) return std::nullopt;
    auto const& typed = static_cast<GridType const&>(*grid);
    return std::make_shared<GridReader<GridType, T>>(typed, grid, path, dtype)->read(options);
}

class VdbParser : public TreeParser {
public:
    explicit VdbParser(std::string const& path) : path_(path), file_(path), listing_(file_.list()) {}

    AmrListing const& listing() const override { return listing_; }

    ParsedTree read(AmrReadOptions const& options) override {
        if (options.dtype)
            throw Error(ErrorKind::usage, text(path_, ": grids are read in their own type"),
                        "convert afterwards: vkt convert");
        openvdb::GridBase::ConstPtr const grid = file_.grid(options.variable);
        DataType const dtype = *dtype_of(*grid);
        if (dtype == DataType::float16)
            if (auto tree = read_as<openvdb::FloatGrid, Half>(grid, path_, options, dtype)) return *std::move(tree);
        if (auto tree = read_as<openvdb::FloatGrid, float>(grid, path_, options, dtype)) return *std::move(tree);
        if (auto tree = read_as<openvdb::DoubleGrid, double>(grid, path_, options, dtype)) return *std::move(tree);
        if (auto tree = read_as<openvdb::Int32Grid, std::int32_t>(grid, path_, options, dtype)) return *std::move(tree);
        if (auto tree = read_as<openvdb::Int64Grid, std::int64_t>(grid, path_, options, dtype)) return *std::move(tree);
        if (auto tree = read_as<openvdb::BoolGrid, std::uint8_t>(grid, path_, options, dtype)) return *std::move(tree);
        if (auto tree = read_as<openvdb::MaskGrid, std::uint8_t>(grid, path_, options, dtype)) return *std::move(tree);
        throw Error(ErrorKind::data,
                    text(path_, ": grid '", grid->getName(), "' has another node layout than OpenVDB's usual one"));
    }

private:
    std::string path_;
    VdbFile file_;
    AmrListing listing_;
};

} // namespace

namespace openvdb_module {

std::shared_ptr<TreeParser> open(std::string const& path) {
    // Files are read by one thread; others would only need memory for their stacks, and wait for it where it is short.
    static tbb::global_control const alone(tbb::global_control::max_allowed_parallelism, 1);
    openvdb::initialize();
    return std::make_shared<VdbParser>(path);
}

} // namespace openvdb_module

} // namespace vkt
