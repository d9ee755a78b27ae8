// What the module hdf5 hands to the library for datasets: their reader.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/parsed_grids.h"

#include <memory>
#include <string>

namespace vkt::hdf5 {

/// The reader of datasets of numbers of one to four dimensions, which runs in a child. The last dimension is x; a first
/// of four enumerates volumes. Spacing and origin from dimension scales with even steps (NetCDF-4) or element_size_um;
/// scale_factor, add_offset and units of NetCDF's conventions. Datasets are variables, named by their paths.
std::unique_ptr<GridsParser> open(std::string const& path);

} // namespace vkt::hdf5
