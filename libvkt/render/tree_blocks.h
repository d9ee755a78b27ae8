// A brick tree cut into blocks that rays march through as through lattices: which there are, and their values.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/sampler.h"
#include "libvkt/core/large_vector.h"
#include "libvkt/render/inner/tree_blocks.h"
#include "libvkt/render/tree_cells.h"

#include <vector>

namespace vkt::render {

/// The blocks of leaves in which something can be seen, and of those around them.
struct StoredBlocks {
    std::vector<BlockLeaf> leaves;
    LargeVector<std::byte> cells; ///< empty: there are none
};

/// An octree whose leaves have at most block_cells cells each way, as wide as the finest ones that reach into them.
/// Where cells of one level reach a leaf, its lattice holds them, and its values are those of the basis reconstruction.
/// Where levels meet, it holds that reconstruction at the centres of the finest cells there, as the grid of all finest
/// cells does.
class TreeBlocks {
public:
    TreeBlocks() = default;
    /// Of a tree without holes in the region. There are none in the end if it is too large for them.
    TreeBlocks(BrickTable const& bricks, Index3 dims, Box const& region);

    bool empty() const { return leaves_.empty(); }
    /// Those that a transfer function asks for, or all; none if they take more than so many bytes. Time grows with
    /// them.
    StoredBlocks store(TreeSampler const& sampler, LatticeType type, TreeCells const& cells,
                       CellVisibility const& visibility, TransferTable const& table, bool all, std::size_t most_bytes,
                       int threads) const;
    BlocksView view(StoredBlocks const& stored) const;
    std::size_t node_count() const { return nodes_.size(); }
    /// Finest cells that a cell of the coarsest leaf is wide.
    double widest() const { return static_cast<double>(std::int64_t{1} << coarsest_); }

private:
    struct Part;
    struct Reach;
    struct Workspace;
    void split(std::size_t node, Part const& part);
    void mark(std::int32_t node, Box const& cube, Box const& box, std::vector<std::uint8_t>& wanted) const;
    Box cube_of(BlockLeaf const& leaf) const;
    void find_reaches(TreeSampler const& sampler, BlockLeaf const& leaf, Box const& within,
                      std::vector<Reach>& reaches) const;
    template <class T> static void copy_cells(Reach const& reach, T const* cells, T* block);
    template <class T> static void add_cells(Reach const& reach, T const* cells, Workspace& work);
    template <class T> void fill(TreeSampler const& sampler, BlockLeaf const& leaf, Workspace& work, T* block) const;

    Index3 dims_;
    Box region_;
    int coarsest_ = 0, root_bits_ = 0;
    Index3 origin_, count_;
    std::vector<std::int32_t> nodes_; ///< as BlocksView has them
    std::vector<BlockLeaf> leaves_;
};

} // namespace vkt::render
