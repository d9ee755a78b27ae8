// How volumes are cut so that a stage keeps its memory: slabs of whole slices, or rows of one where slices are large.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/progress_monitor.h"
#include "libvkt/engine/operation.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace vkt {

/// Extent of the pieces of a volume, x being whole; pieces of fewer rows than a slice has are normally one slice thick.
struct Cut {
    std::int64_t slices = 1, rows = 1;
};

/// Bytes that one piece may have where several are in flight: a sixteenth of the budget. Budgets below 4 MiB, less than
/// any process takes, count as that.
std::size_t piece_limit(Execution const& execution);

/// Pieces of 1 to 4 MiB, of `hint` slices if that is more than 0, but none beyond piece_limit(). Throws
/// Error{resources} where a single row is out of proportion to the budget.
Cut cut_of(Header const& header, std::int64_t hint, Execution const& execution);

/// So many slices, `hint` at least, as suit the device that works on them.
std::int64_t slab_hint_on(Execution const& execution, Header const& header, std::int64_t hint);

/// The pieces of a region, x fastest, each given to f(Box). Slabs lie as those of the whole volume do.
template <class F> void for_each_piece(Box const& region, Cut cut, F const& f) {
    for (std::int64_t z = region.lower.z, end = 0; z < region.upper.z; z = end) {
        end = std::min((z / cut.slices + 1) * cut.slices, region.upper.z);
        for (std::int64_t y = region.lower.y; y < region.upper.y; y += cut.rows)
            f(Box{{region.lower.x, y, z}, {region.upper.x, std::min(y + cut.rows, region.upper.y), end}});
    }
}

/// Which part of the work on a region a piece of it is.
inline ProgressPart part_of(ProgressMonitor* monitor, Box const& region, Box const& piece) {
    std::int64_t const rows = region.dims().y;
    return {monitor, (piece.lower.z - region.lower.z) * rows + (piece.lower.y - region.lower.y) * piece.dims().z,
            piece.dims().y * piece.dims().z, rows * region.dims().z};
}

/// Goes through a region that comes in pieces: take(rest) deals with a first part of `rest` and returns which, as
/// first_part() has it.
template <class F> void for_each_part(Box const& region, F const& take) {
    for (Index3 at = region.lower; at.z < region.upper.z;) {
        Box rest{at, region.upper};
        if (at.y > region.lower.y) rest.upper.z = at.z + 1;
        Box const part = take(rest);
        bool const rows_left = part.upper.y < region.upper.y;
        at.y = rows_left ? part.upper.y : region.lower.y;
        at.z = rows_left ? at.z : part.upper.z;
    }
}
/// What a piece that holds the first voxels of a region has of it: slices with all the region's rows, or rows of one.
inline Box first_part(Box const& region, Box const& piece) {
    Box part = intersect(region, piece);
    if (part.upper.y < region.upper.y) part.upper.z = part.lower.z + 1;
    return part;
}

/// Follows pieces in their order: whole slices, or rows of a single one, without gaps.
class PieceOrder {
public:
    explicit PieceOrder(Index3 dims = {}) : dims_(dims) {}
    bool takes(Box const& piece) const;
    void advance(Box const& piece);
    bool complete() const { return z_ == dims_.z; }
    std::int64_t slices() const { return z_; } ///< that are complete

private:
    Index3 dims_;
    std::int64_t z_ = 0, y_ = 0; ///< the next row
};

/// Blocks of lines that are on their way from the spool and back at once, see LinePasses.
struct LineBlocks {
    Index3 along_y; ///< all 0 if pieces are whole slices, whose lines along y need no way of their own
    Index3 along_z;
};

/// How an operation works within the budget.
struct WorkPlan {
    Cut cut;                         ///< largest region that it computes at once
    bool bands = false;              ///< rows by rows through all slices: the result is spooled, and served from there
    std::optional<LineBlocks> lines; ///< it works on lines: its input comes in pieces, the result is spooled
    bool jumps = false;              ///< it goes back in its inputs
    int threads = 1;                 ///< that it may use: as many as asked for, if what each holds of its own fits
    std::size_t bytes = 0;           ///< held by operation and windows
    std::vector<std::size_t> window; ///< bytes of the largest region that is wanted of each input
};

/// Chooses among slabs, pieces of rows and bands what keeps half the budget, less `spooled` bytes of inputs that are
/// kept in memory, with fewer threads than asked for where they alone keep it from fitting. Inputs of which `lent` says
/// true lie in memory, where a window of them takes none. Throws Error{resources} where nothing would do. The
/// operation's last fit() is for what was chosen.
WorkPlan work_plan(Operation& operation, Plan const& plan, std::span<Header const> inputs,
                   std::vector<bool> const& lent, std::size_t spooled, Execution const& execution);

/// Bytes up to which one of so many inputs that must be read again is kept in memory.
std::size_t spool_limit(std::size_t inputs, Execution const& execution);

} // namespace vkt
