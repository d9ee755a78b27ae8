// Structured to hierarchical: keeps fine bricks only where a coarser level does not reproduce the voxels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/reconstruct.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace vkt {

/// A rising function of stored values, straight between equidistant nodes and constant beyond the ends.
struct ValueScale {
    double low = 0, high = 1;   ///< of the first and the last node
    std::vector<double> values; ///< at least two

    double operator()(double stored) const {
        auto const last = static_cast<double>(values.size() - 1);
        double const at = std::clamp((stored - low) / (high - low), 0.0, 1.0) * last; // NaN stays
        if (!(at < last)) return at >= last ? values.back() : at;
        auto const i = static_cast<std::size_t>(at);
        return values[i] + (at - static_cast<double>(i)) * (values[i + 1] - values[i]);
    }
};

struct RefineOptions {
    double tolerance = 0;   ///< largest |reconstruction - voxel| at voxel centres, in stored values
    std::int64_t block = 8; ///< cells of a brick along each axis, 1 … 64
    /// Eight bricks of one level that fill a brick of twice as many cells along each axis become that, as long as it
    /// has no more than this: bricks of mixed sizes, and the same cells.
    std::int64_t largest = 0;
    int levels = 8;                                ///< most levels, 1 … 16
    Reconstruction method = Reconstruction::basis; ///< the promise holds for basis or for nearest
    /// If set, differences are those of this function of the values, and the tolerance is one of it.
    std::optional<ValueScale> scale;
    /// If set, differences are those of the gradient: of each component, by central differences (one-sided at faces),
    /// for voxels so far apart along each axis. The tolerance is stored values per length.
    std::optional<Vec3> gradient_spacing;
    std::optional<double> background; ///< blocks within the tolerance of this value are left out: a sparse volume
};

/// Builds the coarsest tree of octree blocks whose reconstruction at the voxels' centres stays within the tolerance:
/// starts from blocks that their level's means (interpolated) reproduce, then checks the whole reconstruction and
/// splits what fails until nothing does. Coarse cells are means of their voxels. Blocks at edges that no coarse cell
/// fits stay fine. Attribute "background" names the physical value of left-out blocks. Throws Error{usage}.
/// Memory: the volume, 8/7 doubles for every eighth voxel, the tree. O(voxels * levels).
/// With a scale, or of the gradient, the same holds for these differences.
Volume refine(Volume const& volume, RefineOptions const& options, Execution const& execution);

} // namespace vkt
