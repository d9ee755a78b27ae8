// Types of HDF5 and of voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/types.h"

#include "libvkt/core/text.h"

#include <array>

namespace vkt::hdf5 {
namespace {

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

using PartNames = std::array<char const*, 2>;

/// Of the real and the imaginary part; null if the structure has none.
PartNames const* names_of_parts(hid_t type) {
    static constexpr PartNames known[] = {{"r", "i"}, {"real", "imag"}}; // h5py's and MATLAB's
    for (PartNames const& names : known)
        if (H5Tget_member_index(type, names[0]) >= 0 && H5Tget_member_index(type, names[1]) >= 0) return &names;
    return nullptr;
}

} // namespace

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

std::optional<DataType> complex_part(hid_t type) {
    if (H5Tget_class(type) != H5T_COMPOUND || H5Tget_nmembers(type) != 2) return std::nullopt;
    PartNames const* const names = names_of_parts(type);
    if (names == nullptr) return std::nullopt;
    auto const member = [&](char const* name) {
        return Handle(H5Tget_member_type(type, static_cast<unsigned>(H5Tget_member_index(type, name))), H5Tclose);
    };
    Handle const real = member((*names)[0]), imaginary = member((*names)[1]);
    auto const kind = type_of(real);
    return kind && plain(real) && H5Tequal(real, imaginary) > 0 ? kind : std::nullopt;
}

Handle part_type(hid_t type, int part) {
    char const* const name = (*names_of_parts(type))[part == 0 ? 0 : 1];
    Handle const member(H5Tget_member_type(type, static_cast<unsigned>(H5Tget_member_index(type, name))), H5Tclose),
        own = memory_type(member);
    Handle result(H5Tcreate(H5T_COMPOUND, H5Tget_size(own)), H5Tclose);
    H5Tinsert(result, name, 0, own);
    return result;
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

std::string other_elements(hid_t type) {
    switch (H5Tget_class(type)) {
    case H5T_COMPOUND:
        return names_of_parts(type) != nullptr ? "complex numbers" : "structures";
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

bool plain(hid_t type) {
    std::size_t const size = H5Tget_size(type);
    if (H5Tget_class(type) == H5T_COMPOUND) return false; // of complex numbers
    return H5Tget_class(type) != H5T_INTEGER ||
           (H5Tget_precision(type) == 8 * size && (size == 1 || size == 2 || size == 4 || size == 8));
}

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

} // namespace vkt::hdf5
