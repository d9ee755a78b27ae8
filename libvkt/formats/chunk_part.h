// Parts of chunks whose voxels lie in a file as they are: only what a region has of them is read.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace vkt {

/// Copies `n` bytes of a chunk from byte `at` on.
using ReadChunk = std::function<void(std::int64_t at, std::byte* to, std::size_t n)>;

/// Copies what `out` has of the chunk with this corner and extent, whose voxels are dense, x fastest. `scratch` is kept
/// from call to call.
void read_chunk_part(Index3 corner, Index3 extent, AnyView const& out, std::vector<std::byte>& scratch,
                     ReadChunk const& read);

/// Slices of such chunks of this depth that are best read together: a layer of chunks leaves the caches before it is
/// written, an even part of it does not.
std::int64_t slices_together(std::int64_t depth, std::int64_t slice_bytes);

} // namespace vkt
