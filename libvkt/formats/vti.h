// VTK's XML images: what opens and writes them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"

#include <memory>
#include <string>

namespace vkt {

/// The first array, or the one that the options name; of what vkt wrote as a series, all. Throws Error{data} for
/// damaged files.
std::unique_ptr<Source> open_vti(std::unique_ptr<ByteSource> bytes, ReadOptions const& options);
/// .vti, or .pvti with its pieces beside it. Channels of one volume become components or arrays.
std::unique_ptr<Sink> create_vti(std::string const& path, WriteOptions const& options);

} // namespace vkt
