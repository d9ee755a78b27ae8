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
    double background = 0;                             ///< where there is no brick at all
};

/// What an operation decided and had to say: of several levels the plan of the first, and all remarks.
struct TreeRun {
    Plan plan;
    std::vector<Remark> remarks;
};

/// Runs an operation on hierarchical volumes:
/// - pointwise: planned once; all inputs must be the same tree on the same grid. Runs brick by brick with positions on
///   the level's lattice, or on long rows of cells if the operation uses no positions.
/// - neighbourhood: planned once a level, as if the level's lattice were a structured volume (spacing times the cell
///   width, so that sizes in world units stay what they are; sizes in voxels mean the level's own cells). Every brick
///   is run with ghost cells: cells of the same level as they are, others reconstructed, the plan's boundary rule
///   outside.
/// - geometric: by the operation's own run_tree().
/// Everything else throws Error{usage} that names `vkt resample`. `told`, if given, receives plan and remarks. A tree
/// of one level gives what the structured volume gives, bit for bit.
Volume apply_hierarchical(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution,
                          TreeOptions const& options = {}, TreeRun* told = nullptr);

/// Feeds all cells to a reduction: plan, then enter_level and scan for runs of bricks of one level, then scan_end.
void reduce_hierarchical(Operation& reduction, Volume const& volume, Execution const& execution);

} // namespace vkt
