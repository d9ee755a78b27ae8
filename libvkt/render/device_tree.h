// A hierarchical volume on a GPU: the arrays of its view, copied there once.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/render/tree.h"

#include <memory>

namespace vkt::render {

/// Copies of what rays there ask for; those of a transfer function are made anew when that is another.
class DeviceTree {
public:
    /// Of a tree that outlives it.
    explicit DeviceTree(Tree const& tree) : tree_(tree) {}

    /// The view of visibility and blocks with all its arrays on the current GPU. `made_for` keeps both alive.
    TreeView view(Tree::Visibility const& visibility, StoredBlocks const& blocks,
                  std::shared_ptr<void const> const& made_for);

private:
    Tree const& tree_;
    Buffer cells_, nodes_, order_, bricks_, cell_first_, cell_bricks_; ///< of the tree
    Buffer range_, visible_before_, leaves_, block_nodes_, block_cells_;
    std::shared_ptr<void const> made_for_;
};

} // namespace vkt::render
