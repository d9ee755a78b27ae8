// A hierarchical volume made ready for rays: index, ranges of bricks, histogram; cells stay where they are.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/sampler.h"
#include "libvkt/render/inner/tree.h"
#include "libvkt/render/transfer.h"
#include "libvkt/render/tree_blocks.h"
#include "libvkt/render/tree_cells.h"
#include "libvkt/render/tree_merge.h"

#include <vector>

namespace vkt::render {

/// Cells of type uint8, uint16, int16 and finite float32 are used in place; others become float and are
/// rescaled where that needs it, as float32 is if its values are extremely large or small. Infinite cells become the
/// nearest finite value of the volume and are counted; NaN means no data. Memory besides cells: about 140 bytes a
/// brick, and macrocells. Small neighbouring bricks of one level
/// are joined, and then the cells are copied.
class Tree {
public:
    /// Throws Error{data} for volumes without bricks or without any finite cell, Error{resources} for bricks of 2^31
    /// cells and more.
    /// `blocks`: it has no holes, and may be marched block by block.
    Tree(Volume const& volume, bool blocks, Execution const& execution);

    Rescaling const& rescaling() const { return rescaling_; } ///< of stored values
    /// Cells count by their volume, because that is what a picture shows.
    Histogram const& histogram() const { return histogram_; }
    /// Finest cells that are shown.
    Box region() const { return region_; }
    /// Finest cells that bricks cover, and the edge of a cell on average, both in finest cells.
    double covered() const { return covered_; }
    double typical_width() const { return typical_width_; }

    /// What a transfer function makes of the bricks.
    struct Visibility {
        std::vector<BrickNodes> range;
        std::vector<std::uint32_t> visible_before;
        std::int64_t visible_count = 0;
        Double3 lower{0, 0, 0}, upper{-1, -1, -1}; ///< box of the domains of visible bricks, in finest cells
    };
    Visibility classify(TransferTable const& table) const;
    /// The blocks for that; none if they take more than so many bytes. `all`: also those in which nothing can be seen.
    StoredBlocks blocks(CellVisibility const& visibility, TransferTable const& table, bool all, std::size_t most_bytes,
                        int threads) const;
    TreeView view(Visibility const& visibility, StoredBlocks const& blocks = {}) const;
    /// How many items a view's arrays have, but for those that follow from visibility and blocks.
    struct Counts {
        std::size_t nodes, order, bricks, cell_first, cell_bricks, block_nodes;
    };
    Counts counts() const {
        return {sampler_.index().nodes().size(),
                sampler_.index().order().size(),
                sampler_.bricks().size(),
                cells_.first.size(),
                cells_.bricks.size(),
                blocks_.node_count()};
    }
    /// The sampled value at a position in finest cells; NaN where there is no data.
    double value_at(Vec3 position) const;
    /// Of those that are left after joining.
    std::size_t brick_count() const { return sampler_.bricks().size(); }
    TreeCells const& cells() const { return cells_; }
    /// Of what rays can meet in a box within a macrocell, in halves of finest cells.
    PartRange range_of_part(Box const& part) const;

private:
    struct Survey;
    Tree(Volume const& volume, bool blocks, Survey const& survey, Execution const& execution);
    Tree(Volume const& volume, bool blocks, Survey const& survey, JoinedBricks const& joined,
         Execution const& execution);

    TreeSampler sampler_;
    Rescaling rescaling_;
    LatticeType type_ = LatticeType::float32;
    double covered_ = 0, typical_width_ = 1;
    Histogram histogram_;
    Box region_;
    std::vector<BrickBox> boxes_;
    std::vector<float> lowest_, highest_; ///< per brick, sampled values; lowest > highest: no data
    std::vector<std::uint8_t> missing_;
    TreeCells cells_;
    TreeBlocks blocks_;
};

} // namespace vkt::render
