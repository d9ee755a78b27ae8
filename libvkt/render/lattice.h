// A volume made ready for rays: padded, in a type that rays can sample, with macrocells and a histogram.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"
#include "libvkt/render/minmax.h"
#include "libvkt/render/tiles.h"
#include "libvkt/render/transfer.h"

#include <functional>

namespace vkt::render {

/// Voxels with two voxels of clamped padding on every side. uint8, uint16 and int16 are kept; other types become float
/// and are rescaled where that needs it (int8 becomes int16). Infinite voxels become the
/// nearest finite value of the volume and are counted; NaN stays and means no data.
struct Lattice {
    Buffer voxels;
    LatticeView view;
    Index3 dims;          ///< without padding
    Rescaling rescaling;  ///< of stored values
    bool missing = false; ///< has NaN
    Histogram histogram;  ///< of physical values
    CellGrid cells;

    /// The sampled value of a voxel of the volume.
    double at(Index3 voxel) const;
};

/// Throws Error{data} for volumes without any finite voxel, Error{resources} beyond memory.
Lattice make_lattice(ConstView voxels, ValueMap const& values, Execution const& execution);

/// Stores all voxels of a structured volume in the window that it is given.
using VoxelReader = std::function<void(AnyView const&)>;

/// The same of a volume with this header that is read now. Types that are kept are read to where they stay, so that the
/// volume is in memory once. Throws what the reader throws, too.
Lattice make_lattice(Header const& header, VoxelReader const& read, Execution const& execution);

} // namespace vkt::render
