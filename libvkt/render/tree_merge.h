// Neighbouring bricks of one level joined into larger ones, which changes no value of the reconstruction.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"

#include <cstdint>
#include <vector>

namespace vkt::render {

/// Most cells of a joined brick along an axis.
inline constexpr std::int64_t widest_joined = 32;

struct JoinedBricks {
    Volume volume;
    std::vector<std::int32_t> into; ///< of every brick of the original
};

/// Rays cross fewer bricks, and fewer of them reach a sample, when neighbours with a common face are one: row by row,
/// then layer by layer. Where that would not halve their number the volume stays as it is. The cells are copied
/// otherwise. O(n log n) in bricks.
JoinedBricks join_bricks(Volume const& volume, Execution const& execution);

} // namespace vkt::render
