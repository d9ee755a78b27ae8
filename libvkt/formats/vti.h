// VTK's XML images: what opens and writes them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"
#include "libvkt/formats/slab_sink.h"

#include <memory>
#include <string>

namespace vkt {

/// The first array, or the one that the options name; of what vkt wrote as a series, all. Throws Error{data} for
/// damaged files.
std::unique_ptr<Source> open_vti(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
/// .vti, or .pvti with its pieces beside it. Channels of one volume become components or arrays.
std::unique_ptr<Sink> create_vti(std::string const& path, WriteOptions const& options);
/// What writes .vti files in order.
std::unique_ptr<VolumeWriter> vti_writer(std::string const& path, WriteOptions const& options);

/// Of images in several files: the folder for them beside NAME.EXTENSION, and whether a folder holds .vti files only.
std::string folder_beside(std::string const& file, std::string const& extension);
bool holds_only_vti(std::string const& folder);
/// As it stands between quotes.
std::string xml_escaped(std::string const& words);

} // namespace vkt
