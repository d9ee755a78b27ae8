// BrickSequence: a hierarchical volume whose cells come a few bricks at a time, from memory or straight from a file.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"

#include <functional>
#include <optional>

namespace vkt {

/// Header and tree are known from the start; cells are read when they are asked for, so that a file passes through a
/// pipe in the memory of one group of bricks.
class BrickSequence {
public:
    /// Writes the cells of `count` bricks from the first on to `to`, dense, in the order of the bricks.
    using Reader = std::function<void(std::size_t first, std::size_t count, std::byte* to)>;

    /// Cells that lie in memory already.
    BrickSequence(Volume volume);
    /// Fills in the header's brick, cell and level counts.
    BrickSequence(Header header, std::vector<Brick> bricks, Reader read);

    Header const& header() const { return whole_ ? whole_->header() : header_; }
    std::vector<Brick> const& bricks() const { return whole_ ? whole_->bricks() : bricks_; }

    /// The cells of `count` bricks, valid until the next call. Throws what the reader throws.
    std::byte const* cells(std::size_t first, std::size_t count);
    /// All of it. The sequence is used up. O(cells), no copy if they lie in memory.
    Volume whole() &&;

private:
    Header header_;
    std::vector<Brick> bricks_;
    Reader read_;
    std::optional<Volume> whole_;
    Buffer group_;
};

} // namespace vkt
