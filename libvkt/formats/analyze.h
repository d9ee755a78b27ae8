// Analyze 7.5: NIfTI's ancestor, a header of 348 bytes beside the voxels, read as SPM and nibabel do.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/raw_source.h"

#include <cstddef>
#include <span>

namespace vkt {

inline constexpr std::size_t analyze_size = 348;

/// True for the first bytes of a header of either byte order that is not NIfTI's.
bool is_analyze(std::span<std::byte const> head);

/// Reads the header and says what it means. The format does not say which end of x is left: as in SPM and nibabel x
/// runs to the left, y to anterior and z to superior, and the world's origin is the voxel that SPM's field names, or
/// the middle of the volume; an attribute says so. SPM's slope and intercept are taken, and the matrix in NAME.mat
/// beside the pair, which gives the place and may say where left is. Throws Error{data}.
RawLayout read_analyze(ByteSource& bytes, bool trust_paths);

} // namespace vkt
