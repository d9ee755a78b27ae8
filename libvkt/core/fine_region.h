// Regions whose ends may lie between voxels: "1.5:30.25,:,10%:90%".
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/core/roi.h"
#include "libvkt/core/types.h"

namespace vkt {

/// Where a region ends, in voxels from the outer face of the first: 1:3 are the faces of the voxels 1 and 2.
struct FineRegion {
    Vec3 lower, upper;
    Box voxels; ///< whose centres lie within, perhaps none; one on the upper end does not

    /// Whether it covers a part of some voxels.
    bool partly() const;
    /// Voxels of which it covers at least a part.
    Box touched() const;
    /// In voxels of a lattice that begins with this one, whose centre is 0.
    Vec3 middle_from(Index3 first) const;
};

/// As Roi::resolve(), but numbers may have a fraction. Throws Error{usage}.
FineRegion resolve_fine(Roi const& roi, Index3 dims);

} // namespace vkt
