// Regions on levels: which cells are theirs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/level_region.h"

#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/tree.h"

namespace vkt {

LevelRegion::LevelRegion(Roi const& roi, Header const& volume) : given_(!roi.empty()) {
    if (volume.kind == Kind::hierarchical)
        finest_ = given_ ? resolve_in_tree(roi, volume) : region_of(volume);
    else
        finest_ = roi.resolve(volume.dims);
    box_ = finest_;
}

void LevelRegion::enter_level(Index3 cell_width, Index3 first) {
    box_ = cells_centred_in({finest_.lower - first, finest_.upper - first}, cell_width);
}

} // namespace vkt
