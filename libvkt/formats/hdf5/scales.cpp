// Making scales of dimensions.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/scales.h"

#include "libvkt/formats/hdf5/attributes.h"

#include <algorithm>
#include <cstddef>
#include <cstdio>

namespace vkt::hdf5 {
namespace {

/// As NetCDF marks dimensions that only have a name and an extent.
std::string no_variable(hsize_t size) {
    char words[80];
    std::snprintf(words, sizeof words, "This is a netCDF dimension but not a netCDF variable.%10lld",
                  static_cast<long long>(size));
    return words;
}

bool put_text(hid_t object, char const* name, std::string const& value) {
    Handle const space(H5Screate(H5S_SCALAR), H5Sclose), type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type, value.size() + 1);
    Handle const attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    return attribute && H5Awrite(attribute, type, value.c_str()) >= 0;
}

bool is_free(hid_t file, std::string const& path) { return H5Lexists(file, path.c_str(), H5P_DEFAULT) == 0; }

/// The samples of a scale, of which there may be none.
bool put_samples(hid_t set, Scale const& scale, hid_t type) {
    if (!scale.names.empty()) {
        std::vector<char const*> words;
        for (std::string const& name : scale.names) words.push_back(name.c_str());
        return H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, words.data()) >= 0;
    }
    return scale.places.empty() ||
           H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, scale.places.data()) >= 0;
}

bool make_scale(hid_t file, std::string const& path, Scale const& scale, std::string const& dataset, User user) {
    hsize_t const most = scale.grows ? H5S_UNLIMITED : scale.size, chunk = std::min<hsize_t>(scale.size, 1024), one = 1;
    Handle const space(H5Screate_simple(1, &scale.size, &most), H5Sclose),
        creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose), type(H5Tcopy(H5T_IEEE_F64LE), H5Tclose),
        word(H5Tcopy(H5T_C_S1), H5Tclose);
    if (scale.grows) H5Pset_chunk(creation, 1, &chunk);
    H5Pset_obj_track_times(creation, false);
    H5Tset_size(word, H5T_VARIABLE);
    H5Tset_cset(word, H5T_CSET_UTF8);
    hid_t const stored = scale.names.empty() ? type : word;
    Handle const set(H5Dcreate2(file, path.c_str(), stored, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose);
    if (!set || !put_samples(set, scale, stored)) return false;
    bool const variable = !scale.places.empty() || !scale.names.empty();
    Handle const users(H5Screate_simple(1, &one, nullptr), H5Sclose), of_users = user_type();
    Handle const list(H5Acreate2(set, users_of, of_users, users, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    return put_text(set, "CLASS", "DIMENSION_SCALE") &&
           put_text(set, "NAME", variable ? scale.name : no_variable(scale.size)) &&
           put_text(set, our_scale, dataset) && (scale.units.empty() || put_text(set, "units", scale.units)) && list &&
           H5Awrite(list, of_users, &user) >= 0;
}

} // namespace

Handle user_type() {
    hid_t const type = H5Tcreate(H5T_COMPOUND, sizeof(User));
    H5Tinsert(type, "dataset", offsetof(User, dataset), H5T_STD_REF_OBJ);
    H5Tinsert(type, "dimension", offsetof(User, dimension), H5T_NATIVE_INT);
    return {type, H5Tclose};
}

bool attach_scales(hid_t file, std::string const& dataset, std::vector<Scale> const& scales) {
    std::string const group = dataset.substr(0, dataset.rfind('/') + 1);
    hobj_ref_t own = 0;
    if (H5Rcreate(&own, file, dataset.c_str(), H5R_OBJECT, -1) < 0) return false;
    std::vector<hobj_ref_t> references(scales.size());
    std::vector<hvl_t> lists(scales.size());
    for (std::size_t k = 0; k < scales.size(); ++k) {
        std::string path = group + scales[k].name;
        if (!is_free(file, path)) path = dataset + "_" + scales[k].name;
        if (!is_free(file, path)) continue;
        if (!make_scale(file, path, scales[k], dataset, {own, static_cast<int>(k)}) ||
            H5Rcreate(&references[k], file, path.c_str(), H5R_OBJECT, -1) < 0)
            return false;
        lists[k] = {1, &references[k]};
    }
    hsize_t const n = lists.size();
    Handle const set(H5Dopen2(file, dataset.c_str(), H5P_DEFAULT), H5Dclose),
        space(H5Screate_simple(1, &n, nullptr), H5Sclose), type(H5Tvlen_create(H5T_STD_REF_OBJ), H5Tclose);
    Handle const attribute(H5Acreate2(set, scales_of, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    return attribute && H5Awrite(attribute, type, lists.data()) >= 0;
}

bool give_way(hid_t file, std::string const& path) {
    Handle const scale(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose);
    std::string const dataset = scale ? words(scale, our_scale) : "";
    if (dataset.empty()) return false;
    std::string const other = dataset + "_" + path.substr(path.rfind('/') + 1);
    return is_free(file, other) && H5Lmove(file, path.c_str(), file, other.c_str(), H5P_DEFAULT, H5P_DEFAULT) >= 0;
}

} // namespace vkt::hdf5
