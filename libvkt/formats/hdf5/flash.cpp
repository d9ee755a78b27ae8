// The FLASH reader; part of the module hdf5.
// SPDX-License-Identifier: MIT
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/flash_module.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/hdf5/open.h"

#include <hdf5.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <unistd.h>
#include <utility>

namespace vkt {

namespace {

using hdf5::Handle; // invalid ones are allowed: opening optional things may fail

/// The library is neither silent nor thread-safe by default: one caller at a time, and no messages on standard error.
class LibraryGuard {
public:
    LibraryGuard() : lock_(mutex()) {
        // Damaged files leave things open inside the library, and it would complain about them when the process ends.
        [[maybe_unused]] static bool const quiet_end = H5dont_atexit() >= 0;
        H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
        H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    }
    ~LibraryGuard() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
    LibraryGuard(LibraryGuard const&) = delete;

private:
    static std::mutex& mutex() {
        static std::mutex instance;
        return instance;
    }
    std::scoped_lock<std::mutex> lock_;
    H5E_auto2_t function_ = nullptr;
    void* data_ = nullptr;
};

constexpr std::int64_t most_blocks = std::int64_t{1} << 28;

std::string trimmed(std::string_view padded) {
    std::size_t end = padded.find('\0');
    end = end == std::string_view::npos ? padded.size() : end;
    while (end > 0 && padded[end - 1] == ' ') --end;
    return std::string(padded.substr(0, end));
}

/// What FLASH's tables say about one block.
struct Block {
    std::array<double, 3> lower{}, size{};
    int refinement = 1; ///< 1-based
    bool leaf = true;
};

/// A run of leaves that follow one another in the file.
struct Run {
    std::int64_t block, brick, count;
};

std::vector<Run> runs_of(std::span<std::int64_t const> blocks) {
    std::vector<Run> list;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
        if (!list.empty() && list.back().block + list.back().count == blocks[i])
            ++list.back().count;
        else
            list.push_back({blocks[i], static_cast<std::int64_t>(i), 1});
    }
    return list;
}

hid_t native_type(DataType dtype) { return dtype == DataType::float32 ? H5T_NATIVE_FLOAT : H5T_NATIVE_DOUBLE; }

class FlashFile : public TreeParser {
public:
    explicit FlashFile(std::string const& path) : path_(path), file_(open(path)) {
        read_sizes();
        read_variables();
        read_blocks();
        place_blocks();
    }
    FlashFile(FlashFile const&) = delete;

    AmrListing const& listing() const override { return listing_; }
    ParsedTree read(AmrReadOptions const& options) override;

private:
    [[noreturn]] void refuse(std::string const& why, std::string hint = {}) const {
        throw Error(ErrorKind::data, text(path_, ": ", why), std::move(hint));
    }

    static Handle open(std::string const& path) {
        if (access(path.c_str(), R_OK) != 0)
            throw Error(ErrorKind::io, text("cannot read ", path, ": ", std::strerror(errno)));
        Handle file = hdf5::open_to_read(path);
        if (!file) throw Error(ErrorKind::data, text(path, ": is not a whole HDF5 file"));
        return file;
    }

    bool has(char const* name) const { return H5Lexists(*file_, name, H5P_DEFAULT) > 0; }

    Handle dataset(std::string const& name) const {
        return {has(name.c_str()) ? H5Dopen2(*file_, name.c_str(), H5P_DEFAULT) : -1, H5Dclose};
    }

    std::vector<std::int64_t> extents(hid_t dataset_id) const {
        Handle const space(H5Dget_space(dataset_id), H5Sclose);
        int const rank = space ? H5Sget_simple_extent_ndims(space) : -1;
        if (rank < 0 || rank > 8) return {};
        std::array<hsize_t, 8> dims{};
        H5Sget_simple_extent_dims(space, dims.data(), nullptr);
        std::vector<std::int64_t> result;
        for (int i = 0; i < rank; ++i) {
            if (dims[static_cast<std::size_t>(i)] > static_cast<hsize_t>(max_extent))
                refuse("a dataset has absurd extents");
            result.push_back(static_cast<std::int64_t>(dims[static_cast<std::size_t>(i)]));
        }
        return result;
    }

    /// A whole table of numbers, as long as `rows` rows of at most `columns` say; the number of columns is returned.
    template <class T> std::int64_t table(char const* name, hid_t type, std::vector<T>& values) const {
        Handle const data = dataset(name);
        if (!data) return 0;
        std::vector<std::int64_t> const dims = extents(data);
        if (dims.empty() || dims[0] != blocks_in_file_) refuse(text("table '", name, "' is not one row a block"));
        std::int64_t columns = 1;
        for (std::size_t i = 1; i < dims.size(); ++i) columns *= dims[i] > 0 && dims[i] <= 64 ? dims[i] : 0;
        if (columns < 1 || columns > 64) refuse(text("table '", name, "' has absurd extents"));
        values.resize(static_cast<std::size_t>(blocks_in_file_ * columns));
        if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
            refuse(text("table '", name, "' cannot be read"));
        return columns;
    }

    /// FLASH's lists of {name, value}: scalars and runtime parameters.
    template <class T> std::map<std::string, T> list(char const* name, hid_t value_type) const {
        std::map<std::string, T> result;
        Handle const data = dataset(name);
        if (!data) return result;
        std::vector<std::int64_t> const dims = extents(data);
        std::int64_t const n = dims.empty() ? 0 : dims[0];
        if (n > 100000) refuse(text("list '", name, "' is absurdly long"));
        constexpr std::size_t name_size = 80;
        constexpr std::size_t record_size = name_size + sizeof(T);
        Handle const word(H5Tcopy(H5T_C_S1), H5Tclose);
        H5Tset_size(word, name_size);
        Handle const record(H5Tcreate(H5T_COMPOUND, record_size), H5Tclose);
        H5Tinsert(record, "name", 0, word);
        H5Tinsert(record, "value", name_size, value_type);
        std::vector<char> bytes(static_cast<std::size_t>(n) * record_size);
        if (n > 0 && H5Dread(data, record, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0)
            refuse(text("list '", name, "' cannot be read"));
        for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
            char const* const at = bytes.data() + i * record_size;
            T value;
            std::memcpy(&value, at + name_size, sizeof value);
            result.emplace(trimmed({at, name_size}), value);
        }
        return result;
    }

    /// One member of the single record of a compound dataset.
    template <class T> std::optional<T> member(char const* name, char const* field, hid_t type) const {
        Handle const data = dataset(name);
        if (!data) return std::nullopt;
        Handle const file_type(H5Dget_type(data), H5Tclose);
        if (H5Tget_class(file_type) != H5T_COMPOUND || H5Tget_member_index(file_type, field) < 0 ||
            extents(data) != std::vector<std::int64_t>{1})
            return std::nullopt;
        Handle const record(H5Tcreate(H5T_COMPOUND, sizeof(T)), H5Tclose);
        H5Tinsert(record, field, 0, type);
        T value{};
        if (H5Dread(data, record, H5S_ALL, H5S_ALL, H5P_DEFAULT, &value) < 0) return std::nullopt;
        return value;
    }

    int find_version() const {
        if (auto const stated = member<int>("sim info", "file format version", H5T_NATIVE_INT)) return *stated;
        if (Handle const data = dataset("file format version"); data) {
            int value = 7;
            if (extents(data).size() <= 1 && H5Sget_simple_extent_npoints(Handle(H5Dget_space(data), H5Sclose)) == 1 &&
                H5Dread(data, H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, &value) >= 0)
                return value;
        }
        return 7;
    }

    void read_sizes();
    void refuse_other_geometry() const;
    void read_variables();
    void read_blocks();
    void place_blocks();
    Index3 roots() const;
    Index3 guard_cells(hid_t data, std::string const& name) const;
    std::size_t block_cells() const { return static_cast<std::size_t>(cells_.x * cells_.y * cells_.z); }
    void read_by_library(Index3 guards, DataType dtype, std::span<std::int64_t const> blocks, std::byte* to) const;

    std::string path_;
    std::optional<Handle> file_;
    std::optional<Handle> data_; ///< the variable that is read
    int version_ = 9;
    std::int64_t blocks_in_file_ = 0;
    Index3 cells_{1, 1, 1}; ///< of a block
    std::vector<std::string> dataset_names_;
    std::vector<Block> blocks_;
    std::vector<std::int64_t> leaf_of_; ///< brick → block in the file
    std::array<double, 3> lower_{}, upper_{};
    std::map<std::string, double> runtime_;
    AmrListing listing_;
};

void FlashFile::read_sizes() {
    version_ = find_version();
    if (version_ < 4 || version_ > 9)
        refuse(text("FLASH file format version ", version_, " is not known"), "versions up to 9 can be read");
    Handle const gid = dataset("gid"), level = dataset("refine level");
    if (!gid || !level || !has("unknown names")) refuse("is HDF5, but not a FLASH file: block tables are missing");
    std::vector<std::int64_t> const dims = extents(gid);
    if (dims.size() != 2 || (dims[1] != 5 && dims[1] != 9 && dims[1] != 15))
        refuse("block table 'gid' has absurd extents");
    blocks_in_file_ = dims[0];
    if (blocks_in_file_ < 1 || blocks_in_file_ > most_blocks) refuse(text("states ", blocks_in_file_, " blocks"));
    listing_.dimensions = dims[1] == 15 ? 3 : dims[1] == 9 ? 2 : 1;
    listing_.blocks_in_file = blocks_in_file_;
    listing_.format = text("FLASH ", version_);

    refuse_other_geometry();
    auto& attributes = listing_.header.attributes;
    auto const integers = list<int>("integer scalars", H5T_NATIVE_INT);
    auto const reals = list<double>("real scalars", H5T_NATIVE_DOUBLE);
    char const* const names[3] = {"nxb", "nyb", "nzb"};
    for (int a = 0; a < listing_.dimensions; ++a) {
        auto const found = integers.find(names[a]);
        std::optional<int> const count = found != integers.end()
                                             ? std::optional<int>(found->second)
                                             : member<int>("simulation parameters", names[a], H5T_NATIVE_INT);
        if (!count || *count < 1 || *count > 1 << 20)
            refuse(text("does not say how many cells a block has ('", names[a], "')"));
        cells_[a] = *count;
    }
    if (auto const total = integers.find("globalnumblocks");
        total != integers.end() && total->second != blocks_in_file_)
        refuse(text("is one part of a split file: ", blocks_in_file_, " of ", total->second, " blocks"),
               "join the parts first");
    if (auto const time = reals.find("time"); time != reals.end())
        attributes["time"] = to_text(time->second);
    else if (auto const old = member<double>("simulation parameters", "time", H5T_NATIVE_DOUBLE))
        attributes["time"] = to_text(*old);
    if (auto const step = integers.find("nstep"); step != integers.end())
        attributes["step"] = to_text(step->second);
    else if (auto const old = member<int>("simulation parameters", "number of steps", H5T_NATIVE_INT))
        attributes["step"] = to_text(*old);
    runtime_ = list<double>("real runtime parameters", H5T_NATIVE_DOUBLE);
}

/// Cells of cylinders and spheres are not boxes: they would be drawn in the wrong place and weighted wrongly.
void FlashFile::refuse_other_geometry() const {
    using Word = std::array<char, 80>;
    Handle const word(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(word, std::tuple_size_v<Word>);
    for (char const* const name : {"string scalars", "string runtime parameters"}) {
        auto const words = list<Word>(name, word);
        auto const found = words.find("geometry");
        if (found == words.end()) continue;
        std::string const geometry = trimmed({found->second.data(), found->second.size()});
        if (geometry != "cartesian" && !geometry.empty())
            refuse(text("has ", geometry, " coordinates, and only Cartesian ones can be read"),
                   "cells would be drawn in the wrong place and weighted by the wrong volume");
    }
}

void FlashFile::read_variables() {
    Handle const data = dataset("unknown names");
    Handle const file_type(H5Dget_type(data), H5Tclose);
    std::int64_t const count = H5Sget_simple_extent_npoints(Handle(H5Dget_space(data), H5Sclose));
    std::size_t const width = H5Tget_size(file_type);
    if (H5Tget_class(file_type) != H5T_STRING || H5Tis_variable_str(file_type) > 0 || count < 0 || count > 100000 ||
        width < 1 || width > 1024)
        refuse("list 'unknown names' is malformed");
    Handle const word(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(word, width);
    H5Tset_strpad(word, H5T_STR_SPACEPAD);
    std::vector<char> names(static_cast<std::size_t>(count) * width);
    if (count > 0 && H5Dread(data, word, H5S_ALL, H5S_ALL, H5P_DEFAULT, names.data()) < 0)
        refuse("list 'unknown names' cannot be read");
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        std::string const padded(names.data() + i * width, width);
        std::string const name = trimmed(padded);
        std::string const stored = !name.empty() && has(padded.c_str()) ? padded : name;
        Handle const variable = name.empty() ? Handle(-1, H5Dclose) : dataset(stored);
        if (!variable) continue; // named, but not written to this file
        Handle const type(H5Dget_type(variable), H5Tclose);
        if (H5Tget_class(type) != H5T_FLOAT) continue;
        AmrVariable entry{name, H5Tget_size(type) <= 4 ? DataType::float32 : DataType::float64, {}, {}};
        auto const limit = [&](char const* what) -> std::optional<double> {
            if (H5Aexists(variable, what) <= 0) return std::nullopt;
            Handle const attribute(H5Aopen(variable, what, H5P_DEFAULT), H5Aclose);
            double value = 0;
            if (!attribute || H5Sget_simple_extent_npoints(Handle(H5Aget_space(attribute), H5Sclose)) != 1 ||
                H5Aread(attribute, H5T_NATIVE_DOUBLE, &value) < 0)
                return std::nullopt;
            return value;
        };
        entry.minimum = limit("minimum");
        entry.maximum = limit("maximum");
        dataset_names_.push_back(stored);
        listing_.variables.push_back(entry);
    }
    if (listing_.variables.empty() && has("unknowns"))
        refuse("packs all variables in one dataset, an experimental layout", "write it without packing");
}

void FlashFile::read_blocks() {
    std::vector<int> level, kind;
    std::vector<double> box, size;
    table("refine level", H5T_NATIVE_INT, level);
    table("node type", H5T_NATIVE_INT, kind);
    std::int64_t const box_columns = table("bounding box", H5T_NATIVE_DOUBLE, box);
    std::int64_t const size_columns = table("block size", H5T_NATIVE_DOUBLE, size);
    int const nd = listing_.dimensions;
    if (box_columns < 2 * nd) refuse("table 'bounding box' is missing or too narrow");
    if (size_columns != 0 && size_columns < nd) refuse("table 'block size' is too narrow");
    blocks_.resize(static_cast<std::size_t>(blocks_in_file_));
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        Block& block = blocks_[b];
        block.refinement = level[b];
        block.leaf = kind.empty() || kind[b] == 1;
        if (block.refinement < 1 || block.refinement > max_level)
            refuse(text("block ", static_cast<std::int64_t>(b), " has refinement level ", level[b]));
        for (std::size_t a = 0; a < static_cast<std::size_t>(nd); ++a) {
            double const low = box[b * static_cast<std::size_t>(box_columns) + 2 * a];
            double const high = box[b * static_cast<std::size_t>(box_columns) + 2 * a + 1];
            block.lower[a] = low;
            block.size[a] = size_columns != 0 ? size[b * static_cast<std::size_t>(size_columns) + a] : high - low;
            if (!std::isfinite(low) || !std::isfinite(high) || !(block.size[a] > 0))
                refuse(text("block ", static_cast<std::int64_t>(b), " has no finite, positive size"));
            lower_[a] = b == 0 ? low : std::min(lower_[a], low);
            upper_[a] = b == 0 ? high : std::max(upper_[a], high);
        }
    }
    // The run's own parameters are double precision; the boxes of a plot file are not.
    char const* const low_names[3] = {"xmin", "ymin", "zmin"};
    char const* const high_names[3] = {"xmax", "ymax", "zmax"};
    for (std::size_t a = 0; a < 3; ++a) {
        auto const low = runtime_.find(low_names[a]), high = runtime_.find(high_names[a]);
        if (low != runtime_.end() && high != runtime_.end() && std::isfinite(low->second) &&
            std::isfinite(high->second) && high->second > low->second) {
            lower_[a] = low->second;
            upper_[a] = high->second;
        }
    }
}

/// Blocks of refinement level 1 along each axis, from the largest block: its size is the least affected by rounding.
Index3 FlashFile::roots() const {
    Block const* coarsest = blocks_.data();
    for (Block const& block : blocks_)
        if (block.refinement < coarsest->refinement) coarsest = &block;
    Index3 n{1, 1, 1};
    for (int a = 0; a < listing_.dimensions; ++a) {
        auto const axis = static_cast<std::size_t>(a);
        double const root = std::ldexp(coarsest->size[axis], coarsest->refinement - 1);
        double const exact = (upper_[axis] - lower_[axis]) / root;
        if (!(exact > 0.5) || exact > 0x1p30 || std::abs(exact - std::rint(exact)) > 0.01)
            refuse(text("the domain is ", exact, " root blocks wide along axis ", a, ", not a whole number"));
        n[a] = std::llround(exact);
    }
    return n;
}

void FlashFile::place_blocks() {
    Index3 const root = roots();
    int finest = 1;
    for (Block const& block : blocks_)
        if (block.leaf) finest = std::max(finest, block.refinement);
    Header& header = listing_.header;
    mark_as_given(header);
    header.kind = Kind::hierarchical;
    for (int a = 0; a < 3; ++a) {
        auto const axis = static_cast<std::size_t>(a);
        bool const used = a < listing_.dimensions;
        double const extent = static_cast<double>(root[a] * cells_[a]) * (used ? std::ldexp(1.0, finest - 1) : 1.0);
        if (extent > static_cast<double>(max_extent)) refuse("the logical grid is absurdly large");
        header.dims[a] = static_cast<std::int64_t>(extent);
        if (used && header.dims[a] == 1 && finest > 1) refuse("an axis of one cell cannot be refined");
        double const width = upper_[axis] - lower_[axis];
        header.geometry.spacing[a] = width > 0 ? width / extent : 1;
        header.geometry.origin[a] = width > 0 ? lower_[axis] + 0.5 * header.geometry.spacing[a] : 0;
    }
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        Block const& block = blocks_[b];
        if (!block.leaf) continue;
        Brick brick{{0, 0, 0}, cells_, finest - block.refinement};
        for (int a = 0; a < listing_.dimensions; ++a) {
            // Positions snap to the lattice of blocks of this refinement: float32 boxes are off by a fraction of a
            // cell.
            auto const axis = static_cast<std::size_t>(a);
            double const n = std::ldexp(static_cast<double>(root[a]), block.refinement - 1);
            double const at = (block.lower[axis] - lower_[axis]) / (upper_[axis] - lower_[axis]) * n;
            if (!(std::abs(at - std::rint(at)) < 0.25) || at < -0.5 || at > n)
                refuse(text("block ", static_cast<std::int64_t>(b), " lies at ", at, " of ", n, " blocks along axis ",
                            a, ", off the block lattice"));
            brick.lower[a] = std::llround(at) * cells_[a] << brick.level;
        }
        listing_.bricks.push_back(brick);
        leaf_of_.push_back(static_cast<std::int64_t>(b));
        header.cell_count += brick.cells();
        header.level_count = std::max(header.level_count, brick.level + 1);
    }
    header.brick_count = static_cast<std::int64_t>(listing_.bricks.size());
    try {
        validate_tree(header.dims, listing_.bricks, Coverage::complete);
    } catch (Error const& error) {
        refuse(error.what(), error.hint());
    }
    blocks_ = {};
}

/// Checks the shape of a variable: blocks, then z, y, x with x fastest, guard cells on both sides.
Index3 FlashFile::guard_cells(hid_t data, std::string const& name) const {
    Index3 guards;
    std::vector<std::int64_t> const dims = extents(data);
    if (dims.size() != 4 || dims[0] != blocks_in_file_)
        refuse(text("variable '", name, "' is not one block of cells for each block of the tree"));
    bool corners = true; // one more along every axis that there is
    for (int a = 0; a < 3; ++a)
        corners = corners && dims[static_cast<std::size_t>(3 - a)] == cells_[a] + (a < listing_.dimensions ? 1 : 0);
    if (corners)
        refuse(text("variable '", name, "' holds values at the corners of cells, and only those of cells are read"),
               "checkpoints hold those of cells, and so do plot files that are written with corners = .false.");
    for (int a = 0; a < 3; ++a) {
        std::int64_t const surplus = dims[static_cast<std::size_t>(3 - a)] - cells_[a];
        if (surplus < 0 || surplus % 2 != 0 || surplus > 64)
            refuse(text("variable '", name, "' has blocks of ", dims[3], " ", dims[2], " ", dims[1],
                        " cells, the file says ", cells_));
        guards[a] = surplus / 2;
    }
    // The storage must be there before memory for it is taken; compression gains at most 1:1032 (deflate).
    double const stored = static_cast<double>(H5Dget_storage_size(data)) * 1032.0;
    double const stated = static_cast<double>(dims[0]) * static_cast<double>(dims[1] * dims[2] * dims[3]) * 4.0;
    if (stored < stated) refuse(text("variable '", name, "' states more cells than the file holds"));
    return guards;
}

void FlashFile::read_by_library(Index3 guards, DataType dtype, std::span<std::int64_t const> blocks,
                                std::byte* to) const {
    LibraryGuard const guard;
    hid_t const type = native_type(dtype);
    std::size_t const block_bytes = block_cells() * size_of(dtype);
    Handle const space(H5Dget_space(*data_), H5Sclose);
    // The selection leaves guard cells out; pieces keep the library's own conversion buffers small.
    std::int64_t const piece =
        std::max<std::int64_t>(1, (std::int64_t{16} << 20) / static_cast<std::int64_t>(block_bytes));
    for (Run const& run : runs_of(blocks))
        for (std::int64_t done = 0; done < run.count; done += piece) {
            std::int64_t const n = std::min(piece, run.count - done);
            auto const size = [](std::int64_t v) { return static_cast<hsize_t>(v); };
            hsize_t const start[4] = {size(run.block + done), size(guards.z), size(guards.y), size(guards.x)};
            hsize_t const count[4] = {size(n), size(cells_.z), size(cells_.y), size(cells_.x)};
            hsize_t const cells = size(n) * block_cells();
            Handle const memory(H5Screate_simple(1, &cells, nullptr), H5Sclose);
            if (H5Sselect_hyperslab(space, H5S_SELECT_SET, start, nullptr, count, nullptr) < 0 ||
                H5Dread(*data_, type, memory, space, H5P_DEFAULT,
                        to + static_cast<std::size_t>(run.brick + done) * block_bytes) < 0)
                refuse(text("the cells of blocks ", run.block + done, "…", run.block + done + n - 1, " of ",
                            blocks_in_file_, " cannot be read"));
        }
}

ParsedTree FlashFile::read(AmrReadOptions const& options) {
    LibraryGuard const guard;
    std::size_t const v = choose_variable(listing_.variables, options.variable, path_);
    AmrVariable const& variable = listing_.variables[v];
    DataType const dtype = options.dtype.value_or(variable.dtype);
    if (dtype != DataType::float32 && dtype != DataType::float64)
        throw Error(ErrorKind::usage, text(path_, ": FLASH variables are read as float32 or float64, not ", dtype),
                    "convert afterwards: vkt convert");
    data_.emplace(dataset(dataset_names_[v]));
    Index3 const guards = guard_cells(*data_, variable.name);

    Header header = listing_.header;
    header.dtype = dtype;
    header.attributes["variable"] = variable.name;
    std::optional<Box> const region = wanted_box(options, header);
    if (region) header.attributes["roi"] = to_text(*region);
    std::vector<std::size_t> const kept = bricks_within(region, listing_.bricks, header.dims);
    std::vector<Brick> bricks = collect(kept, [&](std::size_t i) { return listing_.bricks[i]; });
    std::vector<std::int64_t> blocks = collect(kept, [&](std::size_t i) { return leaf_of_[i]; });

    Handle const type(H5Dget_type(*data_), H5Tclose), creation(H5Dget_create_plist(*data_), H5Pclose),
        file_creation(H5Fget_create_plist(*file_), H5Pclose);
    hsize_t user_block = 0;
    H5Pget_userblock(file_creation, &user_block);
    haddr_t const offset = H5Dget_offset(*data_);
    bool const in_place = H5Pget_layout(creation) == H5D_CONTIGUOUS && H5Pget_external_count(creation) == 0 &&
                          H5Tequal(type, native_type(dtype)) > 0 && offset != HADDR_UNDEF && user_block == 0 &&
                          guards == Index3{0, 0, 0};
    ParsedTree tree{std::move(header), std::move(bricks), {}, {}};
    if (in_place) {
        auto const block_bytes = static_cast<haddr_t>(block_cells() * size_of(dtype));
        tree.places = collect(blocks, [&](std::int64_t block) {
            return static_cast<std::int64_t>(offset + static_cast<haddr_t>(block) * block_bytes);
        });
    } else {
        tree.cells = [this, blocks = std::move(blocks), guards, dtype](std::size_t first, std::size_t count,
                                                                       std::byte* to) {
            read_by_library(guards, dtype, std::span(blocks).subspan(first, count), to);
        };
    }
    return tree;
}

} // namespace

namespace flash {

std::shared_ptr<TreeParser> open(std::string const& path) {
    LibraryGuard const guard;
    return std::make_shared<FlashFile>(path);
}

} // namespace flash

} // namespace vkt
