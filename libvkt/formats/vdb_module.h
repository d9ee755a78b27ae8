// What the module openvdb hands to the library: the functions of vdb.h.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/parsed_tree.h"
#include "libvkt/formats/vdb.h"
#include "libvkt/io/module.h"

#include <string_view>

namespace vkt {

/// Metadata of grids that vkt wrote: first and last voxel of the volume, background included.
inline constexpr char const *box_min_name = "volume_box_min", *box_max_name = "volume_box_max";
/// And its header as vkt's JSON: value map, units and history have no place of their own in OpenVDB.
inline constexpr char const* header_name = "vkt_header";
/// Attribute that names the types of metadata that were no strings, so that they can be written as such again.
inline constexpr char const* types_name = "openvdb types";

/// Metadata that OpenVDB or vkt itself reads, and attributes that follow from the grid; the rest is the user's and is
/// an attribute here and metadata there.
inline bool is_own_metadata(std::string_view name) {
    if (name.starts_with("file_") || name.starts_with("volume_box_")) return true;
    for (std::string_view const own : {"name", "class", "is_saved_as_half_float", "is_local_space", "vector_type",
                                       "value_type", "variable", "background", "roi", header_name, types_name})
        if (name == own) return true;
    return false;
}

struct VdbFunctions {
    decltype(write_vdb)* write;
};

namespace openvdb_module {
/// The reader, which runs in a child.
std::shared_ptr<TreeParser> open(std::string const& path);
void write(Volume const& volume, std::string const& path, VdbWriteOptions const& options);
} // namespace openvdb_module

} // namespace vkt
