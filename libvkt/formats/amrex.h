// AMReX plotfiles (directories with text headers and FAB data) as hierarchical volumes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/tree_file.h"

#include <memory>
#include <string>

namespace vkt {

/// True if the path is a directory with a plotfile's Header. Never throws.
bool is_amrex(std::string const& path);

/// True for what AMReX programs call their plotfiles: plt and digits.
bool is_plotfile_name(std::string const& name);

/// A sink for trees of float32 or float64 whose leaves cover the domain. Coarse cells that finer ones cover, which
/// plotfiles hold too, are their means; they are held in memory until all leaves are written.
std::unique_ptr<Sink> create_amrex(std::string const& path, WriteOptions const& options);

/// Variables with their types and ranges, the tree that remains when covered coarse cells are taken away, geometry.
/// Throws Error{data} for malformed, missing or contradictory headers, Error{io} for what cannot be opened.
AmrListing list_amrex(std::string const& path);

/// The same plotfile, open. Reading: coarse cells that finer boxes cover are removed by box difference; the rest of
/// every box becomes one brick or a few. Ghost cells are dropped; 4- and 8-byte reals of either byte order; refinement
/// ratios that are powers of two, the same along all axes, any per level. The tree must cover the domain. With a region
/// only bricks whose domain meets it are read. Format: AMReX documentation, "AMReX Plotfile Format", and files.
std::shared_ptr<AmrFile> open_amrex(std::string const& path);

/// All cells of one variable: open_amrex(path)->read(…) as a whole.
Volume read_amrex(std::string const& path, AmrReadOptions const& options, Execution const& execution);

} // namespace vkt
