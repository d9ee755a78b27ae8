// FLASH-like files for tests and benchmarks of readers.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/flash_module.h"
#include "libvkt/formats/hdf5_module.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

namespace vkt {

namespace {

struct Entry {
    int refinement;
    Index3 at;          ///< block position among those of its refinement
    std::int64_t brick; ///< -1 for parents
};

class FlashWriter {
public:
    FlashWriter(Volume const& volume, std::string const& path, std::string const& variable,
                FlashWriteOptions const& options)
        : volume_(volume), options_(options), path_(path), variable_(variable) {
        list_blocks();
        H5dont_atexit(); // as the reader: what damaged files left open inside the library is no business of the user's
        file_ = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
        if (file_ < 0) throw Error(ErrorKind::io, text("cannot write ", path));
    }
    ~FlashWriter() {
        if (file_ >= 0) H5Fclose(file_);
    }
    FlashWriter(FlashWriter const&) = delete;

    void write() {
        write_parameters();
        write_tables();
        write_cells();
    }

private:
    static hsize_t size(std::int64_t v) { return static_cast<hsize_t>(v); }

    void require(bool good, char const* what) const {
        if (!good) throw Error(ErrorKind::io, text("cannot write ", what, " to ", path_));
    }

    void list_blocks() {
        auto const& bricks = volume_.bricks();
        Index3 const logical = volume_.header().dims, n = bricks.front().dims;
        int coarsest = 0;
        for (auto const& brick : bricks) coarsest = std::max(coarsest, brick.level);
        // Refinement 1 is the largest block that divides the grid into whole blocks at the coarsest level or above.
        while (divides(logical, n, coarsest + 1)) ++coarsest;
        finest_ = coarsest + 1;
        for (int a = 0; a < 3; ++a) {
            flat_[a] = logical[a] == 1;
            dimensions_ = flat_[a] ? dimensions_ : a + 1;
            roots_[a] = logical[a] / (n[a] << (flat_[a] ? 0 : coarsest));
        }
        for (std::size_t b = 0; b < bricks.size(); ++b) {
            Index3 at;
            Index3 const w = cell_width(logical, bricks[b].level);
            for (int a = 0; a < 3; ++a) {
                if (bricks[b].dims[a] != n[a] || bricks[b].lower[a] % (n[a] * w[a]) != 0)
                    throw Error(ErrorKind::usage, "FLASH files hold equal blocks on a block lattice");
                at[a] = bricks[b].lower[a] / (n[a] * w[a]);
            }
            int const refinement = finest_ - bricks[b].level;
            if (options_.parents) add_parents(refinement, at);
            entries_.push_back({refinement, at, static_cast<std::int64_t>(b)});
        }
    }

    static bool divides(Index3 logical, Index3 n, int level) {
        for (int a = 0; a < 3; ++a)
            if (logical[a] != 1 && logical[a] % (n[a] << level) != 0) return false;
        return true;
    }

    /// Parents precede their first leaf, as in Morton order.
    void add_parents(int refinement, Index3 at) {
        if (refinement == 1) return;
        Index3 const up{flat_[0] ? 0 : at.x >> 1, flat_[1] ? 0 : at.y >> 1, flat_[2] ? 0 : at.z >> 1};
        auto const key = std::tuple(refinement - 1, up.x, up.y, up.z);
        if (parents_.contains(key)) return;
        add_parents(refinement - 1, up);
        parents_[key] = entries_.size();
        entries_.push_back({refinement - 1, up, -1});
    }

    void write_dataset(char const* name, hid_t file_type, hid_t memory_type, std::vector<std::int64_t> const& dims,
                       void const* data) {
        std::vector<hsize_t> const extents = collect(dims, [&](std::int64_t d) -> hsize_t { return size(d); });
        hid_t const space = H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr);
        hid_t const set = H5Dcreate2(file_, name, file_type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
        bool const good = set >= 0 && H5Dwrite(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0;
        H5Dclose(set);
        H5Sclose(space);
        require(good, name);
    }

    template <class T>
    void write_list(char const* name, hid_t type, std::vector<std::pair<std::string, T>> const& values) {
        constexpr std::size_t width = 80;
        std::vector<char> bytes(values.size() * (width + sizeof(T)), ' ');
        for (std::size_t i = 0; i < values.size(); ++i) {
            char* const at = bytes.data() + i * (width + sizeof(T));
            std::memcpy(at, values[i].first.data(), values[i].first.size());
            std::memcpy(at + width, &values[i].second, sizeof(T));
        }
        hid_t const word = H5Tcopy(H5T_C_S1);
        H5Tset_size(word, width);
        hid_t const record = H5Tcreate(H5T_COMPOUND, width + sizeof(T));
        H5Tinsert(record, "name", 0, word);
        H5Tinsert(record, "value", width, type);
        write_dataset(name, record, record, {static_cast<std::int64_t>(values.size())}, bytes.data());
        H5Tclose(record);
        H5Tclose(word);
    }

    void write_parameters() {
        Index3 const n = volume_.bricks().front().dims;
        int const nb[3] = {static_cast<int>(n.x), static_cast<int>(n.y), static_cast<int>(n.z)};
        if (options_.version <= 7) {
            write_dataset("file format version", H5T_STD_I32LE, H5T_NATIVE_INT, {1}, &options_.version);
            struct Record {
                double time;
                int blocks, nxb, nyb, nzb;
            } const values{0.5, static_cast<int>(entries_.size()), nb[0], nb[1], nb[2]};
            hid_t const record = H5Tcreate(H5T_COMPOUND, sizeof(Record));
            H5Tinsert(record, "time", offsetof(Record, time), H5T_NATIVE_DOUBLE);
            H5Tinsert(record, "total blocks", offsetof(Record, blocks), H5T_NATIVE_INT);
            H5Tinsert(record, "nxb", offsetof(Record, nxb), H5T_NATIVE_INT);
            H5Tinsert(record, "nyb", offsetof(Record, nyb), H5T_NATIVE_INT);
            H5Tinsert(record, "nzb", offsetof(Record, nzb), H5T_NATIVE_INT);
            write_dataset("simulation parameters", record, record, {1}, &values);
            H5Tclose(record);
            return;
        }
        hid_t const info = H5Tcreate(H5T_COMPOUND, sizeof(int));
        H5Tinsert(info, "file format version", 0, H5T_NATIVE_INT);
        write_dataset("sim info", info, info, {1}, &options_.version);
        H5Tclose(info);
        write_list<int>("integer scalars", H5T_NATIVE_INT,
                        {{"nxb", nb[0]},
                         {"nyb", nb[1]},
                         {"nzb", nb[2]},
                         {"dimensionality", dimensions_},
                         {"globalnumblocks", static_cast<int>(entries_.size())},
                         {"nstep", 7}});
        write_list<double>("real scalars", H5T_NATIVE_DOUBLE, {{"time", 0.5}});
        std::vector<std::pair<std::string, double>> limits;
        char const* const axes[3] = {"x", "y", "z"};
        for (int a = 0; a < 3; ++a) {
            limits.emplace_back(text(axes[a], "min"), options_.domain_lower[a]);
            limits.emplace_back(text(axes[a], "max"), options_.domain_upper[a]);
        }
        write_list<double>("real runtime parameters", H5T_NATIVE_DOUBLE, limits);
        if (!options_.for_others) return;
        write_list<int>(
            "integer runtime parameters", H5T_NATIVE_INT,
            {{"nblockx", static_cast<int>(roots_[0])},
             {"nblocky", static_cast<int>(roots_[1])},
             {"nblockz", static_cast<int>(roots_[2])},
             {"lrefine_min", 1},
             {"lrefine_max", std::max_element(entries_.begin(), entries_.end(), [](auto const& a, auto const& b) {
                                 return a.refinement < b.refinement;
                             })->refinement}});
        std::array<char, 80> geometry;
        geometry.fill(' ');
        std::memcpy(geometry.data(), options_.geometry.data(), std::min(geometry.size(), options_.geometry.size()));
        hid_t const word = H5Tcopy(H5T_C_S1);
        H5Tset_size(word, geometry.size());
        write_list<std::array<char, 80>>("string runtime parameters", word, {{"geometry", geometry}});
        H5Tclose(word);
    }

    void write_tables() {
        auto const count = static_cast<std::int64_t>(entries_.size());
        // Version 9 writes three columns whatever the dimensionality, older ones as many as there are dimensions.
        int const columns = options_.version >= 9 ? 3 : dimensions_;
        std::vector<int> level, kind;
        std::vector<double> box, extent, centre;
        for (Entry const& entry : entries_) {
            level.push_back(entry.refinement);
            kind.push_back(entry.brick >= 0 ? 1 : 2);
            for (int a = 0; a < columns; ++a) {
                double const width = options_.domain_upper[a] - options_.domain_lower[a];
                double const n =
                    static_cast<double>(roots_[a]) * (flat_[a] ? 1.0 : std::ldexp(1.0, entry.refinement - 1));
                double const low = options_.domain_lower[a] + width * static_cast<double>(entry.at[a]) / n;
                double const high = options_.domain_lower[a] + width * static_cast<double>(entry.at[a] + 1) / n;
                box.push_back(low);
                box.push_back(high);
                extent.push_back(width / n);
                centre.push_back(0.5 * (low + high));
            }
        }
        hid_t const real = options_.single_boxes ? H5T_IEEE_F32LE : H5T_IEEE_F64LE;
        write_dataset("refine level", H5T_STD_I32LE, H5T_NATIVE_INT, {count}, level.data());
        write_dataset("node type", H5T_STD_I32LE, H5T_NATIVE_INT, {count}, kind.data());
        int const links = dimensions_ == 3 ? 15 : dimensions_ == 2 ? 9 : 5;
        std::vector<int> const gid(static_cast<std::size_t>(count * links), -1);
        write_dataset("gid", H5T_STD_I32LE, H5T_NATIVE_INT, {count, links}, gid.data());
        write_dataset("bounding box", real, H5T_NATIVE_DOUBLE, {count, columns, 2}, box.data());
        write_dataset("block size", real, H5T_NATIVE_DOUBLE, {count, columns}, extent.data());
        write_dataset("coordinates", real, H5T_NATIVE_DOUBLE, {count, columns}, centre.data());
        std::string padded = variable_;
        padded.resize(4, ' ');
        hid_t const word = H5Tcopy(H5T_C_S1);
        H5Tset_size(word, 4);
        write_dataset("unknown names", word, word, {1, 1}, padded.data());
        H5Tclose(word);
    }

    void write_cells() {
        DataType const dtype = volume_.header().dtype;
        if (dtype != DataType::float32 && dtype != DataType::float64)
            throw Error(ErrorKind::usage, "FLASH files hold float32 or float64");
        hid_t const type = dtype == DataType::float32 ? H5T_NATIVE_FLOAT : H5T_NATIVE_DOUBLE;
        Index3 const n = volume_.bricks().front().dims;
        Index3 guards;
        for (int a = 0; a < 3; ++a) guards[a] = flat_[a] ? 0 : options_.guard_cells;
        hsize_t const dims[4] = {size(static_cast<std::int64_t>(entries_.size())), size(n.z + 2 * guards.z),
                                 size(n.y + 2 * guards.y), size(n.x + 2 * guards.x)};
        hid_t const space = H5Screate_simple(4, dims, nullptr);
        hid_t const creation = H5Pcreate(H5P_DATASET_CREATE);
        // Cells that are never written (parents, guards) read as NaN.
        double const poison = std::numeric_limits<double>::quiet_NaN();
        H5Pset_fill_value(creation, H5T_NATIVE_DOUBLE, &poison);
        H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY);
        std::string padded = variable_;
        padded.resize(4, ' ');
        hid_t const set = H5Dcreate2(file_, padded.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
        bool good = set >= 0;
        hsize_t const cells = size(n.x * n.y * n.z);
        hid_t const memory = H5Screate_simple(1, &cells, nullptr);
        std::byte const* const data = volume_.buffer().read(Space::host);
        for (std::size_t b = 0; good && b < entries_.size(); ++b) {
            if (entries_[b].brick < 0) continue;
            hsize_t const start[4] = {size(static_cast<std::int64_t>(b)), size(guards.z), size(guards.y),
                                      size(guards.x)};
            hsize_t const count[4] = {1, size(n.z), size(n.y), size(n.x)};
            H5Sselect_hyperslab(space, H5S_SELECT_SET, start, nullptr, count, nullptr);
            auto const offset =
                static_cast<std::size_t>(volume_.brick_offset(static_cast<std::size_t>(entries_[b].brick)));
            good = H5Dwrite(set, type, memory, space, H5P_DEFAULT, data + offset * size_of(dtype)) >= 0;
        }
        H5Sclose(memory);
        H5Dclose(set);
        H5Pclose(creation);
        H5Sclose(space);
        require(good, variable_.c_str());
    }

    Volume const& volume_;
    FlashWriteOptions options_;
    std::string path_, variable_;
    hid_t file_ = -1;
    int finest_ = 1, dimensions_ = 1;
    Index3 roots_{1, 1, 1};
    bool flat_[3] = {};
    std::vector<Entry> entries_;
    std::map<std::tuple<int, std::int64_t, std::int64_t, std::int64_t>, std::size_t> parents_;
};

} // namespace

namespace flash {

void write(Volume const& volume, std::string const& path, std::string const& variable,
           FlashWriteOptions const& options) {
    if (volume.header().kind != Kind::hierarchical || volume.bricks().empty())
        throw Error(ErrorKind::usage, "only hierarchical volumes can be written as FLASH files");
    if (variable.empty() || variable.size() > 4)
        throw Error(ErrorKind::usage, text("'", variable, "' is not a FLASH variable name of up to 4 letters"));
    FlashWriter(volume, path, variable, options).write();
}

} // namespace flash

namespace {
FlashFunctions const functions{flash::write, hdf5::writer};
/// Trees of FLASH files, or datasets, as the first request asks.
ParserHandler parse(std::string const& path) {
    ParserHandler handler;
    return [path, handler](Message& request, std::span<std::byte> window, Message& answer) mutable {
        if (!handler) {
            Message first(request.bytes());
            handler = first.number() == open_grids_request ? answer_about_grids([path] { return hdf5::open(path); })
                                                           : answer_about(flash::open(path));
        }
        handler(request, window, answer);
    };
}
} // namespace

} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_hdf5;
vkt::ModuleExport const vkt_module_hdf5{VKT_VERSION, &vkt::functions, &vkt::parse};
}
