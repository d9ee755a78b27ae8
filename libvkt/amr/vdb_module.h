// What the module openvdb hands to the library: the functions of vdb.h.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/parsed.h"
#include "libvkt/amr/vdb.h"
#include "libvkt/formats/module.h"

namespace vkt {

/// Metadata of grids that vkt wrote: first and last voxel of the volume, background included.
inline constexpr char const *box_min_name = "volume_box_min", *box_max_name = "volume_box_max";
/// And its header as vkt's JSON: value map, units, attributes and history have no place of their own in OpenVDB.
inline constexpr char const* header_name = "vkt_header";

struct VdbFunctions {
    decltype(write_vdb)* write;
};

namespace openvdb_module {
/// The reader, which runs in a child.
std::shared_ptr<TreeParser> open(std::string const& path);
void write(Volume const& volume, std::string const& path, VdbWriteOptions const& options);
} // namespace openvdb_module

} // namespace vkt
