// Operations on hierarchical volumes without resampling: one rule for all, taken from the operation's shape.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/reconstruct.h"
#include "libvkt/engine/operation.h"

#include <vector>

namespace vkt {

/// How neighbourhood operations see across the borders of bricks.
struct TreeOptions {
    Reconstruction ghosts = Reconstruction::automatic; ///< average where neighbours are finer, basis elsewhere
};

/// What an operation decided and had to say: of several levels the plan of the first, and all remarks.
struct TreeRun {
    Plan plan;
    std::vector<Remark> remarks;
};

/// Runs an operation on hierarchical volumes:
/// - pointwise: planned once; all inputs must be the same tree on the same grid. Runs brick by brick with positions on
///   the level's lattice, or on long rows of cells if the operation uses no positions. The background, if the volume
///   names one, is treated like a cell, unless the operation uses positions.
/// - neighbourhood: planned once a level by plan_level(), as if the level's lattice were a structured volume. Every
///   brick is run with ghost cells: cells of the same level as they are, others reconstructed, the background in holes,
///   the plan's boundary rule outside of the volume's region (attribute "roi", or all of it). Cells out there stay what
///   they are. What would spread into holes is lost, since no bricks are added.
/// - geometric: by the operation's own run_tree().
/// Everything else throws Error{usage} that names `vkt resample`. `report`, if given, receives plan and remarks. A tree
/// of one level gives what the structured volume gives, bit for bit.
Volume apply_hierarchical(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution,
                          TreeOptions const& options = {}, TreeRun* report = nullptr);

/// Feeds all cells to a reduction: plan, then enter_level and scan for runs of bricks of one level, then scan_end.
void reduce_hierarchical(Operation& reduction, Volume const& volume, Execution const& execution);

} // namespace vkt
