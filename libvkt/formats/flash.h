// FLASH files (HDF5; format versions 7, 8 and 9): leaf blocks of a variable as a hierarchical volume.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/tree_file.h"

#include <memory>
#include <string>

namespace vkt {

/// True if this build reads and writes HDF5.
bool built_with_hdf5();

/// Variables with their types and stated ranges, the tree of leaf blocks, the geometry.
/// Throws Error{data} for files that are no FLASH files or contradict themselves, Error{io} if it cannot be opened.
AmrListing list_flash(std::string const& path);

/// The same file, open. Reading: leaves only, guard cells stripped, blocks placed on the block lattice of the domain.
/// The tree must cover the domain once; with a region only blocks whose domain meets it are read, and the header's
/// attribute "roi" names it. Memory: about 100 bytes a block, and the cells asked for. Data that lies contiguous in the
/// machine's own number format is read straight into place by all threads, everything else by HDF5, a run of leaves at
/// a time. Format: FLASH User's Guide 4, chapter "IO unit", and files. Throws what list_flash throws. HDF5 runs in a
/// child (libvkt/io/parser.h), which may take as much memory as parser_limits says for this budget.
std::shared_ptr<AmrFile> open_flash(std::shared_ptr<ByteSource const> bytes, std::size_t memory);
std::shared_ptr<AmrFile> open_flash(std::string const& path);

/// All cells of one variable: open_flash(path)->read(…) as a whole.
Volume read_flash(std::string const& path, AmrReadOptions const& options, Execution const& execution);

struct FlashWriteOptions {
    int version = 9;          ///< 8 or 9: layout of the block tables; 7: FLASH2's parameter records as well
    bool single_boxes = true; ///< block tables in float32, as plot files have them; else float64
    int guard_cells = 0;      ///< on each side, filled with NaN
    bool parents = true; ///< write parent blocks; their cells are NaN, so that a reader that keeps them is found out
    bool for_others = false;            ///< write the root blocks and the geometry as well, which other readers ask for
    std::string geometry = "cartesian"; ///< what is written for others
    Vec3 domain_lower{0, 0, 0}, domain_upper{1, 1, 1};
};

/// Writes a tree of equal blocks on the block lattice as a FLASH plot file: for tests and benchmarks of readers.
/// Throws Error{usage} for other trees.
void write_flash(Volume const& volume, std::string const& path, std::string const& variable,
                 FlashWriteOptions const& options);

} // namespace vkt
