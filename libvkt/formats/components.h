// Files whose voxels hold several values side by side (colours, vectors, lists): each component as a volume.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <cstdint>
#include <memory>
#include <optional>

namespace vkt {

/// Where the volumes of a series lie along the axis that enumerates them. Of volume i, attribute "sequence position" is
/// origin + i * step, and "sequence step" the step.
struct SequenceAxis {
    double origin = 0, step = 1;
};

/// What stands side by side in each voxel of a file.
struct Components {
    std::int64_t count = 1;
    /// Where they lie if they are a series; else attribute "channel" of each volume is its number, from 0.
    std::optional<SequenceAxis> along;
};

/// The components one after another, volume by volume of `wide`, whose rows hold all components of their voxels. Rows
/// are read as they are needed where `wide` is of random access; else each of its volumes is kept from the first read
/// on, in a share of the memory and in a file beyond, so that it is decoded once. Throws Error{data} if the rows do not
/// divide into as many components.
std::unique_ptr<Source> component_source(std::unique_ptr<Source> wide, Components components);

} // namespace vkt
