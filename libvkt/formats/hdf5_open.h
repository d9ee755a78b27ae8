// Opening HDF5 files, those without a name among them; for what calls the library.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/hdf5_handle.h"

#include <hdf5.h>

#include <string>

namespace vkt::hdf5 {

/// The file, to be read; false if the library cannot open it.
inline Handle open_to_read(std::string const& path) {
    // The default driver looks for the name behind a link, which decompressed files in /dev/fd do not have.
    Handle const access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    if (path.starts_with("/dev/fd/")) H5Pset_fapl_stdio(access);
    return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose};
}

} // namespace vkt::hdf5
