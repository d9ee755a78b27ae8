// Regions taken before a reduction.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/stepped_region.h"

#include "libvkt/formats/region_source.h"

#include <utility>

namespace vkt {

void SteppedRegion::take(std::vector<std::unique_ptr<Source>>& inputs, Roi const& roi) {
    for (auto& input : inputs)
        input = region_of(std::move(input), roi, {}, [this](SteppedBox const& region) { region_ = region; });
}

Index3 SteppedRegion::in_whole(Index3 taken) const {
    Index3 result = region_.box.lower;
    for (int axis = 0; axis < 3; ++axis) result[axis] += taken[axis] * region_.step[axis];
    return result;
}

} // namespace vkt
