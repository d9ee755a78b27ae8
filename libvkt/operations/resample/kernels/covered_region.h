// What moves inside a region, put where the region covers voxels partly.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/affine.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

/// A region whose ends may lie between voxels, in voxels of the views: voxel i lies between i and i + 1.
struct CoveredRegion {
    Vec3 lower, upper;
    Affine map;             ///< from indices of results to indices of what moves there
    bool continues = false; ///< beyond the region, by a boundary rule; else there is the background
    double background = 0;  ///< stored value
};

/// Results are what is moved, or the background where that comes from beyond the region; of voxels of which the region
/// covers a share, so much of it, and of the original the rest. Views begin at the same voxel; `scratch` has a byte for
/// each. Voxels that get some background are counted as undefined.
VKT_KERNEL(cover_region,
           (ConstView moved, ConstView original, AnyView out, CoveredRegion const& region, AnyView scratch,
            Losses& losses, Execution const& execution),
           (moved, original, out, region, scratch, losses, execution))

} // namespace vkt
