// Opening and listing HDF5 files.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/datasets.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/hdf5/attributes.h"
#include "libvkt/formats/hdf5/filters.h"
#include "libvkt/formats/hdf5/itk.h"
#include "libvkt/formats/hdf5/open.h"
#include "libvkt/formats/hdf5/types.h"
#include "libvkt/formats/raw_source.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

namespace vkt::hdf5 {
namespace {

constexpr std::size_t most_datasets = 4096;

Handle open_file(std::string const& path) {
    H5dont_atexit();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    register_filters();
    return open_to_read(path);
}

std::string real_name(std::string const& path) {
    std::error_code error;
    std::filesystem::path const place = std::filesystem::read_symlink(path, error);
    return !error && std::filesystem::is_regular_file(place, error) ? place.string() : "";
}

} // namespace

Datasets::Datasets(std::string path) : path_(std::move(path)), file_(open_file(path_)), home_(real_name(path_)) {
    if (file_) return;
    bool const matlab = path_.ends_with(".mat");
    fail(matlab ? "HDF5 cannot open it: damaged, or a MATLAB file before 7.3" : "damaged: HDF5 cannot open it",
         matlab ? "in MATLAB: save -v7.3" : "");
}

Datasets::Datasets(std::string path, Handle file) : path_(std::move(path)), file_(std::move(file)) {}

void Datasets::fail(std::string const& what, std::string const& hint) const {
    throw Error(ErrorKind::data, text("'", path_, "': ", what), hint);
}

/// Adds the dataset to those that can be read, or says what it holds instead.
std::string Datasets::look_at(hid_t set, std::string const& path) {
    Handle const type(H5Dget_type(set), H5Tclose), space(H5Dget_space(set), H5Sclose);
    int const rank = H5Sget_simple_extent_ndims(space);
    if (rank < 1 || H5Sget_simple_extent_type(space) != H5S_SIMPLE) return "no array";
    if (H5Aexists(set, "MATLAB_empty") > 0) return "an empty array of MATLAB"; // its numbers are extents
    auto const part = complex_part(type), kind = part ? part : type_of(type);
    if (!kind) return other_elements(type);
    Dataset one;
    one.path = path;
    one.type = *kind;
    one.complex = part.has_value();
    one.shape.resize(static_cast<std::size_t>(rank));
    H5Sget_simple_extent_dims(space, one.shape.data(), nullptr);
    // The classic NetCDF has no types without a sign.
    if (std::string const word = lower_case(words(set, "_Unsigned")); word == "true" || word == "false")
        one.type = with_sign(one.type, word == "false");
    one.scale = words(set, "CLASS") == "DIMENSION_SCALE";
    one.bounds = words(set, "bounds");
    // MATLAB keeps the parts of cells and objects in groups of their own, and texts as numbers.
    if (words(set, "MATLAB_class") == "char" || path.starts_with("/#refs#/") || path.starts_with("/#subsystem#/"))
        one.scale = true;
    datasets_.push_back(std::move(one));
    return {};
}

void Datasets::find_linked(std::string const& path) {
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

void Datasets::check_elsewhere(hid_t data, std::vector<std::string>& not_read) const {
    check_elsewhere(data, home_, 0, not_read);
}

/// HDF5 takes the fill value for a file of a virtual dataset that is not there.
void Datasets::check_elsewhere(hid_t data, std::string const& file, int depth,
                               std::vector<std::string>& not_read) const {
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

void Datasets::find(std::vector<std::string>& not_read) {
    struct Walk {
        Datasets* file;
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
            bool const scale = words(set, "CLASS") == "DIMENSION_SCALE"; // which may be names
            if (!refused.empty() && !scale && w.not_read->size() < 32)
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
    mark_places();
}

/// Of ITK's images: datasets beside the voxels that say where these lie; of NetCDF, the limits of cells.
void Datasets::mark_places() {
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

std::vector<double> Datasets::values(std::string const& path) const {
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

Handle open_to_read(std::string const& path) {
    // The default driver looks for the name behind a link, which decompressed files in /dev/fd do not have.
    Handle const access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    if (path.starts_with("/dev/fd/")) H5Pset_fapl_stdio(access);
    return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose};
}

} // namespace vkt::hdf5
