// What the module tiff hands to the library, and what its reader and writer share.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/io/module.h"

#include <memory>
#include <string>

namespace vkt {

/// What begins the line of an ImageDescription in which vkt keeps the header as its JSON.
inline constexpr char const* tiff_header_line = "vkt=";
/// Of the annotation that is the same in OME's descriptions.
inline constexpr char const* tiff_header_namespace = "vkt";
/// The attribute of that header that lists times at unequal distances.
inline constexpr char const* uneven_times = "sequence positions";

struct TiffFunctions {
    std::unique_ptr<VolumeWriter> (*writer)(std::string const& path, WriteOptions const& options);
};

namespace tiff {

/// The reader, which runs in a child. Stacks of pages of one size and type are volumes; with ImageJ's or OME's
/// description, or tifffile's, hyperstacks are sequences of volumes, time outside and channels inside.
std::unique_ptr<GridsParser> open(std::string const& path);

/// Writes a page a slice as ImageJ does, in BigTIFF from 2 GiB on, --compress: deflate with a predictor. The header
/// stands in a line of the first description. Volumes of several channels are described as OME does.
std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options);

} // namespace tiff

} // namespace vkt
