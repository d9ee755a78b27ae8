// What a file that says nothing of itself is a part of.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt {

/// The path to name instead: of the plot file or Zarr store that a file or folder lies in, of the header beside bare
/// voxels that says they are its own. Empty if there is none. Looks at a few files, and never throws.
std::string whole_of(std::string const& path);

} // namespace vkt
