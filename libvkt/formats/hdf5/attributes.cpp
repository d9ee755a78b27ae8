// Reading attributes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/attributes.h"

#include "libvkt/formats/hdf5/handle.h"

#include <cmath>

namespace vkt::hdf5 {
namespace {

constexpr std::size_t longest_text = std::size_t{16} << 20;

} // namespace

std::vector<double> numbers(hid_t object, char const* name, hssize_t most) {
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

std::optional<double> number(hid_t object, char const* name) {
    auto const values = numbers(object, name);
    return values.size() == 1 && std::isfinite(values[0]) ? std::optional(values[0]) : std::nullopt;
}

std::string words(hid_t object, char const* name) {
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

std::vector<std::string> texts(hid_t object, char const* name) {
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

} // namespace vkt::hdf5
