// ParaView's collections: images of VTK one after another in time, each a file beside the one that names them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"

#include <memory>
#include <string>
#include <string_view>

namespace vkt {

/// True for the beginning of a collection.
bool is_pvd(std::string_view head);
/// The images in the order of their times. Throws Error{data} for damaged collections, for several files of one time,
/// and for files that hold no image.
std::unique_ptr<Source> open_pvd(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
/// NAME.pvd with a folder NAME of .vti files, one a time.
std::unique_ptr<Sink> create_pvd(std::string const& path, WriteOptions const& options);

} // namespace vkt
