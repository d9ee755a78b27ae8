// NumPy's .npy files: a header that is a Python dictionary, and an array.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/raw_source.h"

#include <string>

namespace vkt {

/// Reads the header and says what it means. The index that runs fastest in memory is x: the last one of arrays in C
/// order, so that they are array[z, y, x], the first one of arrays in Fortran order. Two dimensions are one slice, four
/// a series of volumes. Throws Error{data}, also for complex, structured and other types that volumes do not have.
RawLayout read_numpy_header(ByteSource& bytes);

/// The bytes of a header: [z, y, x], or [volume, z, y, x] of several.
std::string numpy_bytes(HeaderText const& header);

/// NumPy's name of a type, little-endian: "<f4", "|u1".
std::string numpy_type_name(DataType type);

} // namespace vkt
