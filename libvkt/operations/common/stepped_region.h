// Every n-th voxel of a region, for reductions that look at boxes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/roi.h"
#include "libvkt/engine/source.h"

#include <memory>
#include <vector>

namespace vkt {

/// Where the voxels that a reduction reads lie in the volume: what it reads instead holds them alone.
class SteppedRegion {
public:
    /// Replaces inputs by what the region takes of each of their volumes, in voxels of its own dims. This must outlive
    /// them.
    void take(std::vector<std::unique_ptr<Source>>& inputs, Roi const& roi);
    /// A voxel of the current volume, as it is counted in the whole.
    Index3 in_whole(Index3 taken) const;

private:
    SteppedBox region_;
};

} // namespace vkt
