// TIFF: which volumes pages make: their type, size and geometry, and where the slices of each volume lie.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/tiff/description.h"
#include "libvkt/formats/tiff/pages.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vkt::tiff {

/// A slice of a volume.
struct Plane {
    std::size_t page = 0; ///< of those that are taken
    std::uint16_t sample = 0;
};

/// Of voxels. Throws Error{data} for pages that make none.
DataType type_of(Pages const& pages, Page const& page);

/// Which page and sample each slice of each volume is, one volume after another. Says in `grids` how many volumes there
/// are, of which dimensions, and what tells them apart. Throws Error{data} if the file is too short for them.
std::vector<Plane> arrange(Pages const& pages, TiffDescription const& about, ParsedGrids& grids);

/// Spacing, orientation and units, of a header whose dimensions are known.
void read_geometry(Pages const& pages, TiffDescription const& about, Header& header);

/// Where the planes lie in the file, if they are there as they are wanted, each in one piece.
void find_places(Pages const& pages, std::vector<Plane> const& planes, TiffDescription const& about,
                 ParsedGrids& grids);

} // namespace vkt::tiff
