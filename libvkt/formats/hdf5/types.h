// What elements of datasets are as voxels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/formats/hdf5/handle.h"

#include <hdf5.h>

#include <optional>
#include <string>

namespace vkt::hdf5 {

/// None of what no voxel can be.
std::optional<DataType> type_of(hid_t type);

/// Of complex numbers as h5py and MATLAB write them, structures of r and i or of real and imag, the type of both; none
/// of anything else.
std::optional<DataType> complex_part(hid_t type);
/// The real (0) or imaginary part (1) of complex numbers, in this machine's byte order.
Handle part_type(hid_t type, int part);

DataType with_sign(DataType type, bool sign);

/// What elements of a type are that no voxel can be.
std::string other_elements(hid_t type);

/// Whether all bits of an element are its value, as a machine has it: integers of files may have fewer, or three bytes.
bool plain(hid_t type);

/// The file's type in this machine's byte order.
Handle memory_type(hid_t type);

} // namespace vkt::hdf5
