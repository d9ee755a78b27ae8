// HDF5 files: which are FLASH files, and names of datasets behind names of files.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"

#include <string>

namespace vkt {

/// What stands behind the colon of FILE:/GROUP/DATASET, "/GROUP/DATASET"; empty for other names.
std::string dataset_in_name(std::string const& name);

/// Whether an HDF5 file is one of FLASH, by a name in its root group; pipes are taken for one.
bool is_flash(ByteSource const& bytes);

} // namespace vkt
