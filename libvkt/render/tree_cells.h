// Macrocells of a brick tree: which bricks reach them and the range of their values, for skipping and for majorants.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/sampler.h"
#include "libvkt/render/minmax.h"

#include <cstdint>
#include <vector>

namespace vkt::render {

/// Cubes of `size` finest cells from `origin`, a power of two of at least 8; together they hold the domains of all
/// bricks within the region. The grid's ranges cover all cells whose weight reaches into a macrocell; its `missing`
/// marks those that some cell without data or some hole reaches into.
struct TreeCells {
    CellGrid grid;
    Double3 origin{0, 0, 0};
    double size = 8;
    std::vector<std::int64_t> first;  ///< where the bricks of a macrocell begin, and the end
    std::vector<std::int32_t> bricks; ///< ascending within each
};

/// At most one macrocell per 64 cells of the volume (but 4096), of 20 bytes each, and one name of a brick, of 4 bytes,
/// per 8 cells (but 262144). Time grows with the cells.
TreeCells make_tree_cells(TreeSampler const& sampler, LatticeType type, Box const& region, int threads);

/// Of what can be sampled in a box within a macrocell, in halves of finest cells; the resolution is half of the
/// narrowest cell that reaches into it. `more`: wider cells than the finest ones there reach further by so many of
/// these.
PartRange range_of_part(TreeSampler const& sampler, LatticeType type, TreeCells const& cells, Box const& part,
                        double more);

} // namespace vkt::render
