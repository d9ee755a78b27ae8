// Names in the root group of an HDF5 file, as far as they can be looked for without the library.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"

#include <string_view>

namespace vkt {

/// Whether a name in the root group contains `words`. Reads the group's metadata alone where they can be followed (HDF5
/// File Format Specification 3, sizes of 8 bytes), else the first and last 4 MiB of the file. `bytes` must be seekable.
bool root_group_names(ByteSource const& bytes, std::string_view words);

} // namespace vkt
