// Optional parts of the build, in a list that CMake generates from what it found.
// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>
#include <vector>

namespace vkt {

struct BuildPart {
    std::string_view name; ///< with what it is for: "Zstandard (.zst, Zarr)"
    bool there;
    std::string_view note; ///< its version, or why it is not there; may be empty
};
std::vector<BuildPart> const& build_parts();

/// Instruction sets that kernels were compiled for: "baseline", "avx2".
std::vector<std::string_view> const& built_kernels();

} // namespace vkt
