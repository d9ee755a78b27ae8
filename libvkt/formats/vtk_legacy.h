// Between reading and writing of VTK's legacy files.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"

#include <memory>
#include <string>
#include <string_view>

namespace vkt {

inline constexpr std::string_view vtk_legacy_magic = "# vtk DataFile Version";

/// A file of one volume, in version 3.0. Throws Error{usage} for what the format cannot hold, Error{io}.
std::unique_ptr<Sink> create_vtk_legacy(std::string const& path, WriteOptions const& options);

} // namespace vkt
