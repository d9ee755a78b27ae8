// Copies of a tree's arrays for the GPU.
// SPDX-License-Identifier: MIT
#include "libvkt/render/device_tree.h"

#include "libvkt/render/device.h"

namespace vkt::render {

TreeView DeviceTree::view(Tree::Visibility const& visibility, StoredBlocks const& blocks,
                          std::shared_ptr<void const> const& made_for) {
    TreeView view = tree_.view(visibility, blocks);
    Tree::Counts const counts = tree_.counts();
    auto const place = [](Buffer& buffer, auto const*& array, std::size_t count, bool anew) {
        if (anew) {
            buffer = Buffer(); // first, as there may not be room for both
            buffer = copied_to_device(array, count * sizeof *array);
        }
        array = on_device<std::remove_cvref_t<decltype(*array)>>(buffer);
    };
    bool const first = made_for_ == nullptr, anew = made_for_ != made_for, marched = view.blocks.cells != nullptr;
    made_for_.reset(); // until all are there
    auto const* cells = static_cast<std::byte const*>(view.cells);
    place(cells_, cells, static_cast<std::size_t>(view.bytes), first);
    view.cells = cells;
    place(nodes_, view.nodes, counts.nodes, first);
    place(order_, view.order, counts.order, first);
    place(bricks_, view.bricks, counts.bricks, first);
    place(cell_first_, view.cell_first, counts.cell_first, first);
    place(cell_bricks_, view.cell_bricks, counts.cell_bricks, first);
    place(range_, view.range, visibility.range.size(), anew);
    place(visible_before_, view.visible_before, visibility.visible_before.size(), anew);
    if (marched) {
        auto const* values = static_cast<std::byte const*>(view.blocks.cells);
        place(block_cells_, values, blocks.cells.size(), anew);
        view.blocks.cells = values;
        place(leaves_, view.blocks.leaves, blocks.leaves.size(), anew);
        place(block_nodes_, view.blocks.nodes, counts.block_nodes, first || block_nodes_.bytes() == 0);
    } else {
        block_cells_ = Buffer(), leaves_ = Buffer();
        view.blocks = {};
    }
    view.boxes = nullptr; // only lists want them
    made_for_ = made_for;
    return view;
}

} // namespace vkt::render
