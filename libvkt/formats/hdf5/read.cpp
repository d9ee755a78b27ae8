// Reading datasets with HDF5: plain ones, MATLAB's (7.3) and NetCDF-4's.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/coordinates.h"
#include "libvkt/formats/hdf5/filters.h"
#include "libvkt/formats/hdf5/open.h"
#include "libvkt/formats/hdf5_module.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/tree_file.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

namespace vkt::hdf5 {
namespace {

constexpr std::size_t most_datasets = 4096, chunk_cache = std::size_t{64} << 20;
constexpr hsize_t longest_scale = hsize_t{1} << 24;
constexpr hssize_t longest_list = 8192; ///< of an attribute, which is no larger than 64 KiB
constexpr std::size_t longest_text = std::size_t{16} << 20;
constexpr std::string_view itk_voxels = "/VoxelData"; ///< the dataset of an image, in its group

std::optional<DataType> type_of(hid_t type) {
    std::size_t const size = H5Tget_size(type);
    switch (H5Tget_class(type)) {
    case H5T_ENUM: { // booleans of h5py
        Handle const base(H5Tget_super(type), H5Tclose);
        return base ? type_of(base) : std::nullopt;
    }
    case H5T_INTEGER: {
        bool const has_sign = H5Tget_sign(type) == H5T_SGN_2;
        if (size == 1) return has_sign ? DataType::int8 : DataType::uint8;
        if (size == 2) return has_sign ? DataType::int16 : DataType::uint16;
        if (size <= 4) return has_sign ? DataType::int32 : DataType::uint32;
        if (size <= 8) return has_sign ? DataType::int64 : DataType::uint64;
        return std::nullopt;
    }
    case H5T_FLOAT: {
        if (H5Tget_precision(type) != 8 * size) return std::nullopt;
        if (size == 2) {
            std::size_t sign = 0, exponent = 0, exponent_size = 0, mantissa = 0, mantissa_size = 0;
            H5Tget_fields(type, &sign, &exponent, &exponent_size, &mantissa, &mantissa_size);
            if (exponent_size != 5) return std::nullopt; // bfloat16
            return DataType::float16;
        }
        if (size == 4) return DataType::float32;
        if (size == 8) return DataType::float64;
        return std::nullopt;
    }
    default:
        return std::nullopt;
    }
}

DataType with_sign(DataType type, bool sign) {
    switch (type) {
    case DataType::uint8:
    case DataType::int8:
        return sign ? DataType::int8 : DataType::uint8;
    case DataType::uint16:
    case DataType::int16:
        return sign ? DataType::int16 : DataType::uint16;
    case DataType::uint32:
    case DataType::int32:
        return sign ? DataType::int32 : DataType::uint32;
    case DataType::uint64:
    case DataType::int64:
        return sign ? DataType::int64 : DataType::uint64;
    default:
        return type;
    }
}

/// What elements of a type are that no voxel can be.
std::string other_elements(hid_t type) {
    switch (H5Tget_class(type)) {
    case H5T_COMPOUND:
        return H5Tget_member_index(type, "r") >= 0 && H5Tget_member_index(type, "i") >= 0 ? "complex numbers"
                                                                                          : "structures";
    case H5T_STRING:
        return "texts";
    case H5T_INTEGER:
    case H5T_FLOAT:
        return text("numbers of ", static_cast<std::int64_t>(H5Tget_precision(type)), " bits in ",
                    static_cast<std::int64_t>(H5Tget_size(type)), " bytes");
    default:
        return "no plain numbers";
    }
}

/// To open objects with, but none that a link leads to in another file, whose name and path `other` becomes then.
Handle within_file(std::string& other) {
    Handle stay(H5Pcreate(H5P_LINK_ACCESS), H5Pclose);
    auto const refuse = [](char const*, char const*, char const* file, char const* path, unsigned*, hid_t,
                           void* where) -> herr_t {
        *static_cast<std::string*>(where) = text(file, ":", path);
        return -1;
    };
    H5Pset_elink_cb(stay, refuse, &other);
    return stay;
}

/// Whether all bits of an element are its value, as a machine has it: integers of files may have fewer, or three bytes.
bool plain(hid_t type) {
    std::size_t const size = H5Tget_size(type);
    return H5Tget_class(type) != H5T_INTEGER ||
           (H5Tget_precision(type) == 8 * size && (size == 1 || size == 2 || size == 4 || size == 8));
}

hid_t native_integer(DataType type) {
    switch (type) {
    case DataType::uint8:
        return H5T_NATIVE_UINT8;
    case DataType::int8:
        return H5T_NATIVE_INT8;
    case DataType::uint16:
        return H5T_NATIVE_UINT16;
    case DataType::int16:
        return H5T_NATIVE_INT16;
    case DataType::uint32:
        return H5T_NATIVE_UINT32;
    case DataType::int32:
        return H5T_NATIVE_INT32;
    case DataType::uint64:
        return H5T_NATIVE_UINT64;
    default:
        return H5T_NATIVE_INT64;
    }
}

/// The file's type in this machine's byte order.
Handle memory_type(hid_t type) {
    if (!plain(type)) return {H5Tcopy(native_integer(*type_of(type))), H5Tclose};
    if (H5Tget_class(type) == H5T_ENUM) {
        Handle const base(H5Tget_super(type), H5Tclose);
        if (H5Tget_size(base) == 1) return {H5Tcopy(type), H5Tclose};
    }
    Handle copy(H5Tcopy(type), H5Tclose);
    H5Tset_order(copy, H5Tget_order(H5T_NATIVE_INT));
    return copy;
}

struct Dataset {
    std::string path;
    DataType type = DataType::float32;
    std::vector<hsize_t> shape;
    bool scale = false; ///< it only says where others lie, or what others are
    std::string bounds; ///< of cells whose places it says: a dataset beside it
};

class File : public GridsParser {
public:
    explicit File(std::string path) : path_(std::move(path)), file_(open_file(path_)), home_(real_name(path_)) {
        if (!file_) fail("damaged: HDF5 cannot open it");
    }

    ParsedGrids open(GridsChoice const& choice) override;
    void read(std::int64_t volume, Box const& box, std::byte* to) override;

private:
    static Handle open_file(std::string const& path) {
        H5dont_atexit();
        H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
        register_filters();
        return open_to_read(path);
    }
    /// Where the file lies, which is handed over open; empty if it has no name.
    static std::string real_name(std::string const& path) {
        std::error_code error;
        std::filesystem::path const place = std::filesystem::read_symlink(path, error);
        return !error && std::filesystem::is_regular_file(place, error) ? place.string() : "";
    }
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", path_, "': ", what), hint);
    }
    void find_datasets(std::vector<std::string>& not_read);
    std::string look_at(hid_t set, std::string const& path);
    void find_linked(std::string const& path);
    void check_elsewhere(hid_t data, std::string const& file, int depth, std::vector<std::string>& not_read) const;
    std::optional<double> number(hid_t object, char const* name) const;
    std::vector<double> numbers(hid_t object, char const* name, hssize_t most = 64) const;
    std::vector<std::string> texts(hid_t object, char const* name) const;
    std::string words(hid_t object, char const* name) const;
    void choose(std::string const& variable, ParsedGrids& grids);
    void mark_places();
    std::vector<double> values(std::string const& path) const;
    bool read_itk(ParsedGrids& grids);
    std::vector<std::string> labels() const;
    Handle scale_of(int dimension) const;
    bool of_time(int dimension) const;
    void read_scales(ParsedGrids& grids);
    void read_series(Header& header);
    void say_places(ParsedGrids& grids) const;
    void read_about(ParsedGrids& grids);
    void use_ours(Header& header, std::string const& json) const;
    void find_places(ParsedGrids& grids) const;
    void find_chunks(std::vector<hsize_t> const& chunk, ParsedGrids& grids) const;

    std::string path_;
    Handle file_;
    std::string home_;
    std::vector<Dataset> datasets_;
    std::optional<Handle> data_, type_, space_;
    std::vector<hsize_t> shape_;
    std::array<int, 3> axis_{-1, -1, -1}; ///< of the dataset: of x, y, z
    std::vector<int> leading_;            ///< those that enumerate volumes, slowest first
    /// Of each of these, what is said of its entries; may be empty.
    std::vector<std::vector<std::map<std::string, std::string>>> leading_places_;
    std::size_t element_ = 1;
};

/// Adds the dataset to those that can be read, or says what it holds instead.
std::string File::look_at(hid_t set, std::string const& path) {
    Handle const type(H5Dget_type(set), H5Tclose), space(H5Dget_space(set), H5Sclose);
    int const rank = H5Sget_simple_extent_ndims(space);
    if (rank < 1 || H5Sget_simple_extent_type(space) != H5S_SIMPLE) return "no array";
    auto const kind = type_of(type);
    if (!kind) return other_elements(type);
    Dataset one;
    one.path = path;
    one.type = *kind;
    one.shape.resize(static_cast<std::size_t>(rank));
    H5Sget_simple_extent_dims(space, one.shape.data(), nullptr);
    // The classic NetCDF has no types without a sign.
    if (std::string const word = lower_case(words(set, "_Unsigned")); word == "true" || word == "false")
        one.type = with_sign(one.type, word == "false");
    one.scale = words(set, "CLASS") == "DIMENSION_SCALE";
    one.bounds = words(set, "bounds");
    // MATLAB keeps the parts of cells and objects in groups of their own, and texts as numbers.
    if (H5Aexists(set, "MATLAB_empty") > 0 || words(set, "MATLAB_class") == "char" || path.starts_with("/#refs#/") ||
        path.starts_with("/#subsystem#/"))
        one.scale = true;
    datasets_.push_back(std::move(one));
    return {};
}

/// A dataset by another of its names, as by a link, if there is one. Links to other files are not followed, since what
/// a file leads to may be none of its writer's.
void File::find_linked(std::string const& path) {
    std::string other;
    Handle const stay = within_file(other);
    Handle const set(H5Oopen(file_, path.c_str(), stay), H5Oclose);
    if (!other.empty())
        fail(text("'", path, "' is a link to another file"), text("read it there: vkt read ", shell_quoted(other)));
    if (!set) return;
    if (H5Iget_type(set) != H5I_DATASET) fail(text("'", path, "' is no dataset"));
    if (std::string const refused = look_at(set, path); !refused.empty())
        fail(text("'", path, "' holds ", refused, "; a volume has one number in each voxel"));
}

/// Voxels in other files are read if those lie beside this one, as with detached headers, and so do the next ones to
/// which they lead. HDF5 takes the fill value for a file of a virtual dataset that is not there.
void File::check_elsewhere(hid_t data, std::string const& file, int depth, std::vector<std::string>& not_read) const {
    if (depth > 8) fail("its virtual datasets are made of others without end");
    Handle const creation(H5Dget_create_plist(data), H5Pclose);
    bool const outside = H5Pget_external_count(creation) > 0 || H5Pget_layout(creation) == H5D_VIRTUAL;
    if (outside && file.empty()) fail("its voxels lie in other files, and it has no name beside which they could be");
    std::vector<char> name(4096);
    for (int i = 0; i < H5Pget_external_count(creation); ++i) {
        off_t offset = 0;
        hsize_t size = 0;
        if (H5Pget_external(creation, static_cast<unsigned>(i), name.size() - 1, name.data(), &offset, &size) >= 0)
            beside(file, name.data(), false);
    }
    std::size_t sources = 0;
    if (H5Pget_layout(creation) != H5D_VIRTUAL || H5Pget_virtual_count(creation, &sources) < 0) return;
    std::set<std::pair<std::string, std::string>> seen;
    for (std::size_t i = 0; i < sources; ++i) {
        std::vector<char> path(4096);
        if (H5Pget_virtual_filename(creation, i, name.data(), name.size()) < 0 ||
            H5Pget_virtual_dsetname(creation, i, path.data(), path.size()) < 0)
            fail("damaged: what its virtual dataset is made of cannot be read");
        std::string const other = name.data();
        if (!seen.insert({other, path.data()}).second) continue;
        std::string const place = other == "." ? file : beside(file, other, false);
        std::error_code error;
        if (!std::filesystem::exists(place, error)) {
            if (not_read.size() < 32)
                not_read.push_back(
                    text("file '", other, "', which is not there: the fill value stands for its voxels"));
            continue;
        }
        std::string led_to;
        Handle const opened = open_to_read(place), stay = within_file(led_to);
        Handle const source(opened ? H5Oopen(opened, path.data(), stay) : -1, H5Oclose);
        if (source && H5Iget_type(source) == H5I_DATASET)
            check_elsewhere(source, place, depth + 1, not_read);
        else
            fail(text("'", other, ":", path.data(), "', of which its virtual dataset is made, is not there itself"),
                 "if you know what it is and trust the file: --trust-paths");
    }
}

void File::find_datasets(std::vector<std::string>& not_read) {
    struct Walk {
        File* file;
        std::vector<std::string>* not_read;
    } walk{this, &not_read};
    auto const visit = [](hid_t root, char const* name, H5O_info_t const* info, void* data) -> herr_t {
        auto& w = *static_cast<Walk*>(data);
        if (info->type != H5O_TYPE_DATASET) return 0;
        try {
            Handle const set(H5Dopen2(root, name, H5P_DEFAULT), H5Dclose);
            if (!set) return 0;
            std::string const path = text("/", name);
            std::string const refused = w.file->look_at(set, path);
            if (!refused.empty() && w.not_read->size() < 32)
                w.not_read->push_back(text("dataset '", path, "', which holds ", refused));
        } catch (...) {
            return -1; // C code lies between
        }
        return w.file->datasets_.size() < most_datasets ? 0 : 1;
    };
    if (H5Ovisit(file_, H5_INDEX_NAME, H5_ITER_INC, visit, &walk) < 0)
        fail(text("its groups cannot be listed: damaged, or written for a newer HDF5 than ", H5_VERS_MAJOR, ".",
                  H5_VERS_MINOR),
             "if a newer HDF5 reads it: h5repack --high=V110 in.h5 out.h5");
}

/// Of ITK's images: datasets beside the voxels that say where these lie; of NetCDF, the limits of cells.
void File::mark_places() {
    for (Dataset const& one : std::vector(datasets_)) {
        if (one.bounds.empty()) continue;
        std::string const beside_it = one.path.substr(0, one.path.rfind('/') + 1) + one.bounds;
        for (Dataset& other : datasets_)
            if (other.path == beside_it) other.scale = true;
    }
    for (Dataset const& voxels : std::vector(datasets_)) {
        if (!voxels.path.ends_with(itk_voxels)) continue;
        std::string const group = voxels.path.substr(0, voxels.path.size() - itk_voxels.size());
        for (Dataset& other : datasets_)
            for (char const* const name : {"/Dimension", "/Directions", "/Origin", "/Spacing"})
                if (other.path == group + name) other.scale = true;
    }
}

/// A small dataset of numbers; empty if it is none.
std::vector<double> File::values(std::string const& path) const {
    auto const found =
        std::find_if(datasets_.begin(), datasets_.end(), [&](Dataset const& d) { return d.path == path; });
    if (found == datasets_.end()) return {};
    hsize_t n = 1;
    for (hsize_t const extent : found->shape) {
        if (extent < 1 || extent > 16) return {};
        n *= extent;
    }
    if (n > 64) return {};
    Handle const set(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
    std::vector<double> result(static_cast<std::size_t>(n));
    if (!set || H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, result.data()) < 0) return {};
    return result;
}

/// An image of ITK's: x first in its lists, a row of Directions for each axis of the voxels, and ITK's world.
bool File::read_itk(ParsedGrids& grids) {
    Header& header = grids.header;
    std::string const& path = header.attributes["variable"];
    if (!path.ends_with(itk_voxels)) return false;
    std::string const group = path.substr(0, path.size() - itk_voxels.size());
    auto const dims = values(group + "/Dimension"), spacing = values(group + "/Spacing"),
               origin = values(group + "/Origin"), directions = values(group + "/Directions");
    std::size_t const rank = dims.size();
    if (rank < 1 || spacing.size() != rank || origin.size() != rank || directions.size() != rank * rank) return false;
    if (shape_.size() == rank + 1)
        fail(text("'", path, "' has ", static_cast<std::int64_t>(shape_.back()),
                  " numbers in each voxel; a volume has one"),
             "take one of them apart with ITK");
    if (shape_.size() != rank) return false;
    // One voxel across counts as an axis here, which choose() may have left out of larger datasets only.
    for (std::size_t a = 0; a < std::min<std::size_t>(rank, 3); ++a) {
        auto const axis = static_cast<int>(a);
        if (spacing[a] > 0 && std::isfinite(spacing[a])) header.geometry.spacing[axis] = spacing[a];
        if (std::isfinite(origin[a])) header.geometry.origin[axis] = origin[a];
        for (std::size_t b = 0; b < std::min<std::size_t>(rank, 3); ++b)
            header.geometry.direction[a][static_cast<int>(b)] = directions[a * rank + b];
    }
    check(header.geometry);
    header.attributes["space"] = "left-posterior-superior";
    for (std::int64_t i = 0; rank == 4 && leading_.size() == 1 && i < grids.volumes; ++i)
        leading_places_[0].push_back({{"sequence position", to_text(origin[3] + spacing[3] * static_cast<double>(i))},
                                      {"sequence step", to_text(spacing[3])}});
    return true;
}

std::vector<double> File::numbers(hid_t object, char const* name, hssize_t most) const {
    if (H5Aexists(object, name) <= 0) return {};
    Handle const attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
    if (!attribute) return {};
    Handle const type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    hssize_t const n = H5Sget_simple_extent_npoints(space);
    H5T_class_t const kind = H5Tget_class(type);
    if (n < 1 || n > most || (kind != H5T_INTEGER && kind != H5T_FLOAT)) return {};
    std::vector<double> values(static_cast<std::size_t>(n));
    if (H5Aread(attribute, H5T_NATIVE_DOUBLE, values.data()) < 0) return {};
    return values;
}

std::optional<double> File::number(hid_t object, char const* name) const {
    auto const values = numbers(object, name);
    return values.size() == 1 && std::isfinite(values[0]) ? std::optional(values[0]) : std::nullopt;
}

std::string File::words(hid_t object, char const* name) const {
    if (H5Aexists(object, name) <= 0) return {};
    Handle const attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
    if (!attribute) return {};
    Handle const type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    if (H5Tget_class(type) != H5T_STRING || H5Sget_simple_extent_npoints(space) != 1) return {};
    Handle const memory(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_cset(memory, H5Tget_cset(type));
    if (H5Tis_variable_str(type) > 0) {
        H5Tset_size(memory, H5T_VARIABLE);
        char* value = nullptr;
        if (H5Aread(attribute, memory, static_cast<void*>(&value)) < 0 || value == nullptr) return {};
        std::string result(value);
        H5free_memory(value);
        return result;
    }
    std::size_t const size = H5Tget_size(type);
    if (size > longest_text) return {};
    std::string result(size + 1, '\0');
    H5Tset_size(memory, size + 1);
    if (H5Aread(attribute, memory, result.data()) < 0) return {};
    result.resize(result.find('\0'));
    return result;
}

/// A list of texts of any length each; empty if it is none.
std::vector<std::string> File::texts(hid_t object, char const* name) const {
    if (H5Aexists(object, name) <= 0) return {};
    Handle const attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
    if (!attribute) return {};
    Handle const type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    hssize_t const n = H5Sget_simple_extent_npoints(space);
    if (n < 1 || n > longest_list || H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) <= 0) return {};
    std::vector<char*> read(static_cast<std::size_t>(n));
    Handle const memory(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_cset(memory, H5Tget_cset(type));
    H5Tset_size(memory, H5T_VARIABLE);
    if (H5Aread(attribute, memory, static_cast<void*>(read.data())) < 0) return {};
    std::vector<std::string> result;
    result.reserve(read.size());
    for (char const* const one : read) result.emplace_back(one == nullptr ? "" : one);
    H5Dvlen_reclaim(memory, space, H5P_DEFAULT, static_cast<void*>(read.data()));
    return result;
}

/// Names of the dimensions where some of them are directions in space; else empty.
std::vector<std::string> File::labels() const {
    std::vector<std::string> result = texts(*data_, "DIMENSION_LABELS");
    if (result.size() != shape_.size() || std::all_of(result.begin(), result.end(), enumerates)) result.clear();
    return result;
}

void File::choose(std::string const& variable, ParsedGrids& grids) {
    std::vector<AmrVariable> all;
    std::vector<std::size_t> index;
    // Lists of numbers count only where there is nothing else, or one is asked for.
    auto const image = [](Dataset const& d) {
        return !d.scale && std::count_if(d.shape.begin(), d.shape.end(), [](hsize_t n) { return n > 1; }) >= 2;
    };
    std::string const wanted = variable.empty() || variable.starts_with('/') ? variable : text("/", variable);
    if (!wanted.empty() &&
        std::none_of(datasets_.begin(), datasets_.end(), [&](Dataset const& d) { return d.path == wanted; }))
        find_linked(wanted);
    bool const any = variable.empty() && std::any_of(datasets_.begin(), datasets_.end(), image);
    for (std::size_t i = 0; i < datasets_.size(); ++i) {
        if (any && !image(datasets_[i])) continue;
        all.emplace_back();
        all.back().name = datasets_[i].path;
        all.back().dtype = datasets_[i].type;
        index.push_back(i);
    }
    if (all.empty()) fail("holds no dataset of numbers");
    std::size_t chosen = 0;
    if (wanted.empty() && all.size() > 1)
        for (std::size_t i : index) {
            Dataset const& d = datasets_[i];
            std::string shape;
            for (std::size_t k = d.shape.size(); k-- > 0;)
                shape += text(shape.empty() ? "" : " x ", static_cast<std::int64_t>(d.shape[k]));
            grids.choices.emplace_back(d.path, text(d.type, ", ", shape));
        }
    else
        chosen = choose_variable(all, wanted, path_);
    Dataset const& d = datasets_[index[chosen]];
    Handle const access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
    H5Pset_chunk_cache(access, 12421, chunk_cache, 1);
    if (!home_.empty()) { // relative names of other files begin there, not where the command runs
        std::string const folder = std::filesystem::path(home_).parent_path().string();
        H5Pset_virtual_prefix(access, folder.c_str());
        H5Pset_efile_prefix(access, folder.c_str());
    }
    data_.emplace(H5Dopen2(file_, d.path.c_str(), access), H5Dclose);
    if (!*data_) fail(text("damaged: dataset '", d.path, "' cannot be opened"));
    type_.emplace(H5Dget_type(*data_), H5Tclose);
    space_.emplace(H5Dget_space(*data_), H5Sclose);
    shape_ = d.shape;
    element_ = size_of(d.type);
    grids.header.dtype = d.type;
    grids.header.attributes["variable"] = d.path;
    if (Handle const creation(H5Dget_create_plist(*data_), H5Pclose); grids.choices.empty())
        if (std::string const absent = absent_filter(creation); !absent.empty())
            fail(text("dataset '", d.path, "' is compressed by ", absent, ", which is not read"),
                 "where that filter is: h5repack -f GZIP=4 in.h5 out.h5");
    // The last dimensions with more than one sample, the last one x; a first one of times enumerates volumes.
    int next = 0;
    auto const rank = static_cast<int>(shape_.size());
    for (hsize_t const n : shape_)
        if (n == 0 || n > static_cast<hsize_t>(max_extent)) fail(text("dataset '", d.path, "' is empty, or too large"));
    auto const first = std::find_if(shape_.begin(), shape_.end(), [](hsize_t n) { return n > 1; });
    int const times = first != shape_.end() && of_time(static_cast<int>(first - shape_.begin()))
                          ? static_cast<int>(first - shape_.begin())
                          : -1;
    std::vector<std::string> const names = labels();
    for (int k = rank - 1; k >= 0; --k) {
        bool const named = !names.empty() && enumerates(names[static_cast<std::size_t>(k)]);
        if (!named && shape_[static_cast<std::size_t>(k)] == 1 && (rank > 4 || next >= 3)) continue;
        if (!named && next == 4)
            fail(text("dataset '", d.path, "' has more than four dimensions"), "take a part of it with h5py");
        bool const first_of_times = k == times && next >= 1;
        if (named || first_of_times || next == 3)
            leading_.insert(leading_.begin(), k);
        else
            axis_[static_cast<std::size_t>(next)] = k;
        if (first_of_times) break;
        if (!named) ++next;
    }
    leading_places_.resize(leading_.size());
    for (int a = 0; a < 3; ++a)
        if (int const k = axis_[static_cast<std::size_t>(a)]; k >= 0)
            grids.header.dims[a] = static_cast<std::int64_t>(shape_[static_cast<std::size_t>(k)]);
    for (int const k : leading_) grids.volumes *= static_cast<std::int64_t>(shape_[static_cast<std::size_t>(k)]);
}

/// The dataset that says where the samples along a dimension lie; false if there is none.
Handle File::scale_of(int dimension) const {
    Handle none(-1, H5Dclose);
    if (H5Aexists(*data_, "DIMENSION_LIST") <= 0) return none;
    Handle const attribute(H5Aopen(*data_, "DIMENSION_LIST", H5P_DEFAULT), H5Aclose);
    if (!attribute) return none;
    Handle const type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
    if (H5Tget_class(type) != H5T_VLEN || H5Sget_simple_extent_npoints(space) != static_cast<hssize_t>(shape_.size()))
        return none;
    std::vector<hvl_t> lists(shape_.size());
    if (H5Aread(attribute, type, lists.data()) < 0) return none;
    hvl_t const& list = lists[static_cast<std::size_t>(dimension)];
    Handle scale(list.len < 1 ? -1 : H5Rdereference2(*data_, H5P_DEFAULT, H5R_OBJECT, list.p), H5Dclose);
    H5Dvlen_reclaim(type, space, H5P_DEFAULT, lists.data());
    return scale;
}

/// By the name of the dimension, its axis (CF conventions), or a unit such as "hours since 2000-01-01".
bool File::of_time(int dimension) const {
    Handle const scale = scale_of(dimension);
    if (!scale) return false;
    std::array<char, 256> path{};
    H5Iget_name(scale, path.data(), path.size());
    std::string const name = path.data();
    return enumerates(name.substr(name.rfind('/') + 1)) || words(scale, "axis") == "T" ||
           words(scale, "units").find(" since ") != std::string::npos;
}

/// Coordinates of the samples along each dimension, where they have even steps.
void File::read_scales(ParsedGrids& grids) {
    Header& header = grids.header;
    std::array<std::string, 3> units;
    for (int k = 0; k < static_cast<int>(shape_.size()); ++k) {
        auto const axis = std::find(axis_.begin(), axis_.end(), k) - axis_.begin();
        auto const lead = std::find(leading_.begin(), leading_.end(), k) - leading_.begin();
        if (axis == std::ssize(axis_) && lead == std::ssize(leading_)) continue;
        Handle const scale = scale_of(k);
        if (!scale) continue;
        Handle const scale_space(H5Dget_space(scale), H5Sclose), scale_type(H5Dget_type(scale), H5Tclose);
        hsize_t n = 0;
        if (H5Sget_simple_extent_ndims(scale_space) != 1 || H5Sget_simple_extent_dims(scale_space, &n, nullptr) != 1 ||
            n != shape_[static_cast<std::size_t>(k)] || n > longest_scale || !type_of(scale_type))
            continue;
        if (words(scale, "NAME").starts_with("This is a netCDF dimension but not a netCDF variable")) continue;
        std::vector<double> at(n);
        if (H5Dread(scale, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, at.data()) < 0) continue;
        if (axis == std::ssize(axis_)) {
            leading_places_[static_cast<std::size_t>(lead)] = sequence_places(at, words(scale, "units"));
            continue;
        }
        units[static_cast<std::size_t>(axis)] = words(scale, "units");
        place_axis(header, static_cast<int>(axis), at);
    }
    if (!units[0].empty() && units[0].find('"') == std::string::npos && units[0] == units[1] && units[0] == units[2])
        header.attributes["space units"] = text("\"", units[0], "\" \"", units[0], "\" \"", units[0], "\"");
}

/// Times and channels as vkt writes them, of the dimensions that are named so.
void File::read_series(Header& header) {
    std::vector<std::string> const names = labels();
    auto const stated = [&](char const* name) {
        auto const found = header.attributes.find(name);
        return found == header.attributes.end() ? std::nullopt : number_in(found->second);
    };
    for (std::size_t i = 0; i < leading_.size() && !names.empty(); ++i) {
        auto const k = static_cast<std::size_t>(leading_[i]);
        auto const n = static_cast<std::size_t>(shape_[k]);
        auto& places = leading_places_[i];
        auto const channels = texts(*data_, channel_attribute);
        if (names[k] == "c" && channels.size() == n) {
            places.clear();
            for (std::string const& channel : channels) places.push_back({{"channel", in_utf8(channel)}});
        }
        if (names[k] != "t") continue;
        auto const at = numbers(*data_, position_attribute, longest_list);
        auto const first = stated("sequence position"), step = stated("sequence step");
        if (at.size() == n) places = sequence_places(at, in_utf8(words(*data_, units_attribute)));
        for (std::size_t t = 0; at.empty() && first && step && n <= longest_scale && t < n; ++t)
            places.push_back({{"sequence position", to_text(*first + static_cast<double>(t) * *step)}});
        // What the header says is not rounded.
        for (auto& said : places)
            for (char const* const name : {"sequence step", "sequence units"})
                if (header.attributes.contains(name)) said.erase(name);
    }
}

/// What is said of each volume.
void File::say_places(ParsedGrids& grids) const {
    bool const any =
        std::any_of(leading_places_.begin(), leading_places_.end(), [](auto const& p) { return !p.empty(); });
    for (std::int64_t v = 0; any && v < grids.volumes; ++v) {
        auto& said = grids.attributes.emplace_back();
        auto rest = static_cast<std::size_t>(v);
        for (std::size_t i = leading_.size(); i-- > 0;) {
            auto const n = static_cast<std::size_t>(shape_[static_cast<std::size_t>(leading_[i])]);
            if (!leading_places_[i].empty())
                said.insert(leading_places_[i][rest % n].begin(), leading_places_[i][rest % n].end());
            rest /= n;
        }
    }
}

void File::read_about(ParsedGrids& grids) {
    Header& header = grids.header;
    hid_t const data = *data_;
    if (!read_itk(grids)) read_scales(grids);
    if (auto const size = numbers(data, "element_size_um"); size.size() == 3 && axis_[2] >= 0) { // z, y, x
        for (int a = 0; a < 3; ++a)
            if (double const s = size[static_cast<std::size_t>(2 - a)]; s > 0 && std::isfinite(s))
                header.geometry.spacing[a] = s;
        header.attributes["space units"] = "\"um\" \"um\" \"um\"";
    }
    if (auto const spacing = numbers(data, "spacing"), origin = numbers(data, "origin");
        spacing.size() == 3 && origin.size() == 3 && axis_[2] >= 0)
        for (int a = 0; a < 3; ++a) {
            auto const k = static_cast<std::size_t>(2 - a);
            if (spacing[k] > 0 && std::isfinite(spacing[k])) header.geometry.spacing[a] = spacing[k];
            if (std::isfinite(origin[k])) header.geometry.origin[a] = origin[k];
        }
    double const slope = number(data, "scale_factor").value_or(1), offset = number(data, "add_offset").value_or(0);
    if (slope != 0) header.values = {slope, offset};
    header.units = words(data, "units");
    if (std::string const name = words(data, "long_name"); !name.empty()) header.attributes["long_name"] = name;
    for (char const* const name : {"_FillValue", "missing_value"})
        if (auto fill = number(data, name)) {
            bool const turned = *fill < 0 && is_integer(header.dtype) && !is_signed(header.dtype); // as _Unsigned says
            if (turned) *fill += std::ldexp(1.0, static_cast<int>(8 * size_of(header.dtype)));
            header.attributes[name] = to_text(*fill);
        }
    header = in_utf8(std::move(header));
    use_ours(header, words(data, header_attribute));
    read_series(header);
    say_places(grids);
}

/// What vkt wrote has all of the header, and counts as long as spacing and origin are still those written with it.
void File::use_ours(Header& header, std::string const& json) const {
    if (json.empty()) return;
    try {
        Header ours = header_from_json(json);
        check(ours);
        auto const same = [&](char const* name, Vec3 v) {
            return numbers(*data_, name) == std::vector<double>{v.z, v.y, v.x};
        };
        if (ours.kind != Kind::structured || !(ours.dims == header.dims) || ours.dtype != header.dtype ||
            ours.values != header.values || !same("spacing", ours.geometry.spacing) ||
            !same("origin", ours.geometry.origin))
            return;
        ours.attributes["variable"] = header.attributes["variable"];
        ours.dry_run = ours.timing = false;
        header = std::move(ours);
    } catch (Error const&) { // a damaged one is none
    }
}

/// Contiguous data in the machine's own format are read without the library.
void File::find_places(ParsedGrids& grids) const {
    Handle const creation(H5Dget_create_plist(*data_), H5Pclose), file_creation(H5Fget_create_plist(file_), H5Pclose);
    hsize_t user_block = 0;
    H5Pget_userblock(file_creation, &user_block);
    haddr_t const offset = H5Dget_offset(*data_);
    bool const as_it_is = plain(*type_) && user_block == 0;
    bool const in_order = std::is_sorted(leading_.begin(), leading_.end()) &&
                          (leading_.empty() || leading_.back() < static_cast<int>(leading_.size()));
    if (as_it_is && in_order && H5Pget_layout(creation) == H5D_CONTIGUOUS && H5Pget_external_count(creation) == 0 &&
        offset != HADDR_UNDEF) {
        std::int64_t const slice = grids.header.dims.x * grids.header.dims.y * static_cast<std::int64_t>(element_);
        std::int64_t const slices = grids.header.dims.z * grids.volumes;
        grids.big_endian = H5Tget_order(*type_) == H5T_ORDER_BE;
        if (slices > (std::int64_t{1} << 24)) return;
        for (std::int64_t i = 0; i < slices; ++i) grids.places.push_back(static_cast<std::int64_t>(offset) + i * slice);
    }
    if (H5Pget_layout(creation) != H5D_CHUNKED || axis_[2] < 0) return;
    std::vector<hsize_t> chunk(shape_.size());
    if (H5Pget_chunk(creation, static_cast<int>(chunk.size()), chunk.data()) <= 0) return;
    grids.slab = static_cast<std::int64_t>(
        std::clamp<hsize_t>(chunk[static_cast<std::size_t>(axis_[2])], 1, shape_[static_cast<std::size_t>(axis_[2])]));
    if (as_it_is && H5Pget_nfilters(creation) == 0) find_chunks(chunk, grids);
}

/// The same of chunks that no filter changed. Those that are missing hold the fill value, which the library knows.
void File::find_chunks(std::vector<hsize_t> const& chunk, ParsedGrids& grids) const {
#if H5_VERSION_GE(1, 10, 5)
    constexpr std::size_t most = 2048; // each is looked for among all
    std::vector<hsize_t> at(shape_.size(), 0);
    std::vector<std::int64_t> places;
    std::size_t count = 1;
    for (std::size_t k = 0; k < shape_.size(); ++k) {
        bool const spatial = k + 3 >= shape_.size();
        if (spatial ? axis_[shape_.size() - 1 - k] != static_cast<int>(k) : chunk[k] != 1) return;
        count *= static_cast<std::size_t>((shape_[k] + chunk[k] - 1) / chunk[k]);
        if (count > most) return;
        if (spatial) grids.chunk[static_cast<int>(shape_.size() - 1 - k)] = static_cast<std::int64_t>(chunk[k]);
    }
    for (std::size_t i = 0; i < count; ++i) {
        std::size_t rest = i;
        for (std::size_t k = shape_.size(); k-- > 0;) {
            std::size_t const n = static_cast<std::size_t>((shape_[k] + chunk[k] - 1) / chunk[k]);
            at[k] = rest % n * chunk[k];
            rest /= n;
        }
        unsigned filtered = 0;
        haddr_t place = HADDR_UNDEF;
        hsize_t bytes = 0;
        if (H5Dget_chunk_info_by_coord(*data_, at.data(), &filtered, &place, &bytes) < 0 || place == HADDR_UNDEF)
            return;
        places.push_back(static_cast<std::int64_t>(place));
    }
    grids.big_endian = H5Tget_order(*type_) == H5T_ORDER_BE;
    grids.chunk_places = std::move(places);
#else
    static_cast<void>(chunk), static_cast<void>(grids);
#endif
}

ParsedGrids File::open(GridsChoice const& choice) {
    std::string const& variable = choice.variable;
    ParsedGrids grids;
    if (H5Lexists(file_, "refine level", H5P_DEFAULT) > 0 && H5Lexists(file_, "node type", H5P_DEFAULT) > 0 &&
        variable.empty())
        throw Error(ErrorKind::usage, text("'", path_, "' is a FLASH file"), "read it as one: --format flash");
    if (variable.empty() && H5Lexists(file_, "sim info", H5P_DEFAULT) > 0 &&
        H5Lexists(file_, "particle names", H5P_DEFAULT) > 0)
        fail("is a FLASH file of particles, which are no volume", "plot files and checkpoints hold cells");
    if (variable.empty() && H5Lexists(file_, "minc-2.0", H5P_DEFAULT) > 0)
        fail("is a MINC file, which is not read", "with FreeSurfer or MINC's tools: mri_convert in.mnc out.nii.gz");
    find_datasets(grids.not_read);
    mark_places();
    choose(variable, grids);
    if (!choice.trust_paths) check_elsewhere(*data_, home_, 0, grids.not_read);
    read_about(grids);
    find_places(grids);
    return grids;
}

void File::read(std::int64_t volume, Box const& box, std::byte* to) {
    std::vector<hsize_t> start(shape_.size(), 0), count(shape_.size(), 1);
    for (int a = 0; a < 3; ++a)
        if (int const k = axis_[static_cast<std::size_t>(a)]; k >= 0) {
            start[static_cast<std::size_t>(k)] = static_cast<hsize_t>(box.lower[a]);
            count[static_cast<std::size_t>(k)] = static_cast<hsize_t>(box.dims()[a]);
        }
    auto rest = static_cast<hsize_t>(volume);
    for (std::size_t i = leading_.size(); i-- > 0;) {
        auto const k = static_cast<std::size_t>(leading_[i]);
        start[k] = rest % shape_[k];
        rest /= shape_[k];
    }
    // Of the same shape: HDF5 looks up the chunk of every element otherwise, thirty times as long.
    Handle const memory(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose),
        type = memory_type(*type_);
    H5Sselect_hyperslab(*space_, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    if (H5Dread(*data_, type, memory, *space_, H5P_DEFAULT, to) < 0)
        fail("damaged: voxels cannot be read, or are compressed in a way that this HDF5 does not know");
}

} // namespace

Handle open_to_read(std::string const& path) {
    // The default driver looks for the name behind a link, which decompressed files in /dev/fd do not have.
    Handle const access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    if (path.starts_with("/dev/fd/")) H5Pset_fapl_stdio(access);
    return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose};
}

std::unique_ptr<GridsParser> open(std::string const& path) { return std::make_unique<File>(path); }

} // namespace vkt::hdf5
