// What the module hdf5 hands to the library for datasets: their reader.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/slab_sink.h"

#include <memory>
#include <string>

namespace vkt::hdf5 {

/// The reader of datasets of numbers of one to four dimensions, which runs in a child. The last dimension is x; a first
/// of four enumerates volumes, and so do those that are labelled t or c, besides the others. Spacing and origin from
/// dimension scales with even steps (NetCDF-4), element_size_um, or attributes of these names; scale_factor, add_offset
/// and units of NetCDF's conventions. Datasets are variables, named by their paths.
std::unique_ptr<GridsParser> open(std::string const& path);

/// The attribute in which vkt keeps the header as its JSON.
inline constexpr char const* header_attribute = "vkt";
/// Of a series: times along its dimension t, what they are in, and what the channels along its dimension c are called.
inline constexpr char const *position_attribute = "sequence_position", *units_attribute = "sequence_units",
                            *channel_attribute = "channel";

/// Writes one dataset [z, y, x], of a series with t, c or both before these, FILE:/GROUP/DATASET (/data), in chunks,
/// --compress: shuffle and deflate; its dimensions have scales. Attributes in
/// the order of its axes: spacing, origin, element_size_um; scale_factor, add_offset, units of NetCDF's conventions.
std::unique_ptr<VolumeWriter> writer(std::string const& path, WriteOptions const& options);

/// With options.at: writes volumes into a dataset that is there, chunk by chunk, as it is stored. All else of the file
/// stays; a changed copy takes its name in the end.
std::unique_ptr<VolumeWriter> region_writer(std::string const& path, WriteOptions const& options);

} // namespace vkt::hdf5
