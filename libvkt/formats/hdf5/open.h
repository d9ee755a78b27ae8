// Opening HDF5 files, those without a name among them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/hdf5/handle.h"

#include <string>

namespace vkt::hdf5 {

/// The file, to be read; false if the library cannot open it. Defined beside what lists datasets.
Handle open_to_read(std::string const& path);
/// To open objects with, but none that a link leads to in another file, whose name and path `other` becomes then.
Handle within_file(std::string& other);

} // namespace vkt::hdf5
