// Operations on hierarchical volumes without resampling: one rule for all, taken from the operation's shape.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/reconstruct.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/pipeline.h"

#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace vkt {

/// How neighbourhood operations see across the borders of bricks.
struct TreeOptions {
    Reconstruction ghosts = Reconstruction::automatic; ///< average where neighbours are finer, basis elsewhere
};

/// How an operation comes by the bricks of its inputs, and what it holds of them.
enum class TreeAccess : std::uint8_t {
    streaming, ///< some bricks at a time, as they come
    again,     ///< the same, but all of them more than once: a file is read again, a pipe is spooled
    window,    ///< bricks and their neighbours, as far as the budget goes; the result is spooled
    whole,     ///< all of them in memory
};

struct TreeWork {
    TreeAccess access = TreeAccess::streaming;
    std::size_t bytes = 0; ///< held at most
    /// Access again: bytes up to which what cannot be read again is kept in memory. Window, and whole for
    /// neighbourhoods: those that a brick with its neighbours may take.
    std::size_t keep = 0;
};

/// How an operation of a shape keeps the budget on hierarchical volumes. `largest` are the bytes of the largest brick
/// of each input; where they are not known yet no brick is taken for large. Throws Error{resources} where nothing would
/// do.
TreeWork tree_work(Shape shape, Plan const& plan, std::span<Header const> inputs, std::span<std::size_t const> largest,
                   Execution const& execution);

/// What passing a hierarchical volume on takes: its table of bricks and some of them.
std::size_t bricks_in_flight(Header const& header, Execution const& execution);

/// An operation at work on hierarchical volumes:
/// - pointwise: begun once; all inputs must be the same tree on the same grid. Runs on bricks as they come, with
///   positions on the level's lattice, or on long rows of cells if the operation uses no positions. The background, if
///   the volume names one, is treated like a cell, unless the operation uses positions.
/// - neighbourhood: planned and begun level by level, as if the level's lattice were a structured volume. Every brick
///   is run with ghost cells: cells of the same level as they are, others reconstructed, the background in holes, the
///   plan's boundary rule outside of the volume's region (attribute "roi", or all of it). Cells out there stay what
///   they are. What would spread into holes is lost, since no bricks are added. Levels come one after the other, so
///   that bricks are wanted in another order than they have: they are read again or spooled, and the result is.
/// - header only (the plan's shift is 0): the bricks are handed through.
/// - geometric otherwise: by the operation's own move_bricks().
/// Everything else throws Error{usage} that names `vkt resample`. A tree of one level gives what the structured volume
/// gives, bit for bit.
class TreeRun {
public:
    /// What cannot be done is refused here, before a cell was looked at, except by a scan. The operation must outlive
    /// the sequence; it is planned and begun here.
    TreeRun(Operation& operation, std::vector<BrickSequence> inputs, Execution const& execution,
            StageInfo const& info = {}, TreeOptions const& options = {});

    /// Of several levels the plan of the first; its output is the header of the result.
    Plan const& plan() const;
    /// The result under this header, computed when it is asked for. Once.
    BrickSequence bricks(Header header);
    /// Of what was computed so far; of several levels those of all.
    std::vector<Remark> remarks() const;

    class Work;

private:
    std::vector<Header> headers_; ///< of the inputs
    std::shared_ptr<Work> work_;
};

/// Convenience for library users: the result in memory.
Volume apply_hierarchical(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution,
                          TreeOptions const& options = {});

/// Feeds all cells to a reduction: plan, begin, then enter_level and scan for bricks as they come, then scan_end.
void reduce_hierarchical(Operation& reduction, BrickSequence bricks, Execution const& execution,
                         StageInfo const& info = {});

} // namespace vkt
