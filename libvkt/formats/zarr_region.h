// Writing a region of a Zarr array that is there.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"
#include "libvkt/formats/slab_sink.h"

#include <memory>
#include <string>

namespace vkt {

/// Into the array at `path`, "STORE" or "STORE:/ARRAY", from options.at on. Files that the region meets are written
/// beside the array first, whole, and take their names one after another at the end. Throws Error{usage} for stores in
/// ZIP files, images of several levels, and arrays that are encoded in ways that are only read.
std::unique_ptr<VolumeWriter> zarr_region_writer(std::string const& path, WriteOptions const& options);

} // namespace vkt
