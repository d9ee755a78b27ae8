// Hierarchical to hierarchical without touching values: crop by region, flip, merging of sibling blocks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/tree.h"
#include "libvkt/core/brick_sequence.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/roi.h"

#include <functional>
#include <vector>

namespace vkt {

/// A region of finest cells of a tree of these dims. Throws Error{usage} as Roi::resolve() does; cells are of several
/// sizes, and of these no every n-th one is taken.
Box resolve_cells(Roi const& roi, Index3 dims);

/// The bricks whose domain meets a region of finest cells, whole and in their order; the logical grid stays, the
/// header's attribute "roi" names the region. Any reconstruction inside the region is the same as before, bit for bit.
/// Cells come when they are asked for, in that space. Throws Error{usage} if the region leaves what an earlier crop
/// left, or meets no brick.
BrickSequence crop_tree(BrickSequence bricks, Box const& region, Space space = Space::host);

/// Makes the cells of a brick of those of another. Both lie dense where the execution works.
using MoveCells = std::function<void(ConstView from, std::byte* to, Execution const& execution)>;

/// A tree of as many bricks of as many cells, each made by `move` of the brick at its place in the input, as they are
/// asked for. The header counts nothing yet.
BrickSequence moved_tree(BrickSequence input, Header header, std::vector<Brick> bricks, MoveCells move,
                         Execution const& execution);

/// The mirrored tree: bricks reversed along an axis, and their cells by `mirror`; cells keep their world positions.
BrickSequence flip_tree(BrickSequence bricks, Axis axis, MoveCells mirror, Execution const& execution);

/// Joins 2 x 2 x 2 sibling bricks of one level into one brick, again and again while the result has at most
/// `largest` cells along an axis. Reconstructions stay what they were (to rounding); there are fewer bricks to visit.
Volume merge_siblings(Volume const& volume, std::int64_t largest, Execution const& execution);

} // namespace vkt
