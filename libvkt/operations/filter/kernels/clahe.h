// Contrast-limited equalisation, the mapping: every voxel by the curves of the eight bricks around it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/losses.h"
#include "libvkt/operations/filter/clipped_curve.h"
#include "libvkt/operations/statistics/kernels/histogram.h"

namespace vkt {

/// What voxels are mapped by. A curve has bins + 1 points: the share of a brick's voxels below each edge, from 0 to 1,
/// with straight lines between them. A voxel's share is interpolated linearly between the curves of the bricks whose
/// centres are around the voxel's; beyond the outermost centres the outermost curves hold. The share of the window is
/// the new value.
struct ClaheField {
    BrickGrid grid;
    int bins = 256;
    /// Curves are of double, else of float; voxels are computed with as double or, if `whole`, as 64-bit integers.
    bool wide = false, whole = false;
    Int128 base = 0;          ///< whole: what everything below counts from
    double low = 0, high = 1; ///< the window, of stored values
    /// bin = (v * scale - scaled_low) * per_unit; v = (scaled_low + share * scaled_width) / scale. A power of two that
    /// keeps differences of the largest doubles finite, and 1 for all others.
    double scale = 1, scaled_low = 0, scaled_width = 1, per_unit = 256;
};

/// `curves`: of all bricks of the grid, x fastest. out.box lies in the grid. Counts voxels outside of the window as
/// clipped; NaN stays what it is.
VKT_KERNEL(clahe_map,
           (ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
            Execution const& execution),
           (in, out, field, curves, losses, execution))

/// The curves of all bricks of the grid from their counts: field.bins + 3 a brick, as count_in_bins() leaves them; what
/// is below and above the window is in its first and last bin. Both lie in the memory of `execution`. On a GPU not with
/// ClipRule::pizer, which sorts the bins.
VKT_KERNEL(clahe_curves,
           (std::uint64_t const* counts, ClaheField const& field, ClipLimit const& limit, std::byte* curves,
            Execution const& execution),
           (counts, field, limit, curves, execution))

/// Bytes of the curves of one brick.
inline std::size_t curve_bytes(ClaheField const& field) {
    return static_cast<std::size_t>(field.bins + 1) * (field.wide ? sizeof(double) : sizeof(float));
}

} // namespace vkt
