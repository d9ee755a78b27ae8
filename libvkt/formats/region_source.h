// A part of every volume of a source, read without reading the rest.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/roi.h"
#include "libvkt/engine/source.h"

#include <functional>
#include <memory>

namespace vkt {

/// The region of each volume, resolved against its own dims and geometry; at most one of the two may be given. Access
/// is that of the source. Histories get the step `crop --roi`. Throws Error{usage} for hierarchical volumes.
/// `on_region` is told the region of each volume, in its voxels; may be empty.
std::unique_ptr<Source> region_of(std::unique_ptr<Source> source, Roi roi, WorldRoi world_roi,
                                  std::function<void(SteppedBox const&)> on_region = {});

} // namespace vkt
