// How much two volumes differ, from one pass over both.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/engine/source.h"

namespace vkt {

/// Differences of physical values (slope * stored + intercept). Equal infinities and any two NaN are equal; a NaN
/// against a number is an infinite difference.
struct DifferenceResult {
    bool same_dims = false, same_type = false, same_geometry = false;
    bool same_tree = true; ///< of hierarchical volumes: the same bricks in the same order
    bool comparable() const { return same_dims && same_tree; }
    std::int64_t count = 0, differing = 0;
    Index3 first; ///< first differing voxel in x-fastest order, if any; of trees the first one's lower corner
    double max_abs = 0;
    double rmse = 0;
    double psnr = 0;  ///< 20 log10(range / rmse) in dB, range = max - min of the first volume; infinite if equal
    double range = 0; ///< that range
};

/// Throws Error{usage} for a tree and a grid, which cannot be compared.
void require_same_kind(Header const& a, Header const& b);

/// Compares the current volumes of two sources slab by slab, or the cells of two trees, and finishes both. Volumes of
/// different dims and trees of different bricks are not compared further. The same bits for every thread count and slab
/// height. Throws Error{usage} for a tree and a grid.
DifferenceResult compare(Source& a, Source& b, Execution const& execution);

} // namespace vkt
