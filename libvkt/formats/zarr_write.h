// Writing Zarr arrays, and OME-Zarr images of several resolutions.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"

#include <memory>
#include <string>

namespace vkt {

/// An array of version 2 or 3, [z, y, x], in a directory, or in a ZIP file (stored), that appears whole or not at all;
/// with options.pyramid an OME-Zarr image (0.4 in version 2, 0.5 in version 3) of which each level has half the voxels
/// along each axis, means of those that they cover. Chunks of zeros are left out. Threads compress chunks, --compress:
/// Blosc's Zstandard with its shuffle, else zlib. With options.at a region of an array that is there.
std::unique_ptr<Sink> create_zarr(std::string const& path, WriteOptions const& options);

} // namespace vkt
