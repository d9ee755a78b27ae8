// OpenVDB files: leaf nodes and tiles of a grid as a hierarchical volume, and volumes of both kinds as grids.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/tree_file.h"

#include <memory>
#include <optional>
#include <string>

namespace vkt {

/// True if this build reads and writes OpenVDB files.
bool built_with_openvdb();

/// The scalar grids of a file by name, with their types; header and tree are those of no grid in particular.
/// Throws Error{data} for files that are not OpenVDB's, Error{io} if it cannot be opened.
AmrListing list_vdb(std::string const& path);

/// Reads one grid. Leaf nodes become bricks of 8^3 voxels, inactive ones included; tiles that are active or differ from
/// the background become bricks of constant cells 8 (128 in the largest tiles) voxels wide. Float grids saved as half
/// arrive as float16; double, int32, int64 and bool (uint8) keep their type. What no node holds is a hole: attribute
/// "background" names the value there, "roi" the volume's box if the writer said it (vkt does), else that of the active
/// voxels, "class" the grid's class (fog, level set). Throws Error{usage} for unknown names, Error{data} for vectors,
/// points, strings and transforms that are not linear.
Volume read_vdb(std::string const& path, AmrReadOptions const& options, Execution const& execution);

/// The same file, open. OpenVDB runs in a child (libvkt/io/parser.h), which may take as much memory as parser_limits
/// says for this budget and holds the grid; its voxels come when they are asked for.
std::shared_ptr<AmrFile> open_vdb(std::shared_ptr<ByteSource const> bytes, std::size_t memory);
std::shared_ptr<AmrFile> open_vdb(std::string const& path);

struct VdbWriteOptions {
    std::string name = "density"; ///< of the grid
    double background = 0;        ///< voxels of this stored value are not kept
    std::optional<double> prune;  ///< also voxels this near it; nodes whose voxels differ by no more become tiles
    std::string grid_class;       ///< "fog volume", "level set" or empty
    std::string shown;            ///< what messages call the file, if not by its path
};

/// Writes a structured or hierarchical volume as one grid: cells of coarse levels become tiles where they fill nodes.
/// float16 is saved as half; 8- to 32-bit signed and 8- and 16-bit unsigned integers become int32, uint32 and int64
/// become int64. Value map, units, attributes and history are kept as metadata, and equal volumes make equal files.
/// Throws Error{usage} for uint64 and extents beyond 2^31, Error{io}.
void write_vdb(Volume const& volume, std::string const& path, VdbWriteOptions const& options);

} // namespace vkt
