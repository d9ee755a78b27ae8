// Whole volumes in memory: header, bricks and voxels. A structured volume is one brick; a hierarchical one is many.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/brick_table.h"
#include "libvkt/core/buffer.h"
#include "libvkt/core/header.h"

#include <memory>
#include <vector>

namespace vkt {

/// The header of a hierarchical volume of these bricks: kind and counts of bricks, cells and levels filled in.
/// Throws Error{data} for headers that check() refuses.
Header with_counts(Header header, BrickTable const& bricks);

/// Voxels of all bricks follow one another in one buffer, in the order of `bricks`, each brick dense with x fastest.
/// Structured volumes have exactly one brick of level 0 that covers the dims. Copies share the voxels.
class Volume {
public:
    Volume() = default;
    /// A structured volume with unspecified voxels.
    explicit Volume(Header header);
    /// A structured volume whose voxels are in the buffer already, x fastest.
    Volume(Header header, Buffer voxels);
    /// A hierarchical volume; fills in the header's brick, cell and level counts.
    Volume(Header header, std::vector<Brick> bricks);
    /// The same of bricks that another volume has.
    Volume(Header header, BrickTable const& bricks);
    /// The same, with cells that are in the buffer already, brick after brick.
    Volume(Header header, BrickTable const& bricks, Buffer cells);

    Header const& header() const { return header_; }
    Header& header() { return header_; }
    BrickTable const& bricks() const { return bricks_; }
    Buffer& buffer() const { return *buffer_; }

    /// Structured: all voxels.
    ConstView view() const { return brick_view(0); }
    AnyView mutable_view() { return mutable_brick_view(0); }
    /// Brick i as a window whose lower corner is voxel (0,0,0) of the brick.
    ConstView brick_view(std::size_t i) const;
    AnyView mutable_brick_view(std::size_t i);
    /// Index of brick i's first cell in the buffer.
    std::int64_t brick_offset(std::size_t i) const { return bricks_.offset(i); }

private:
    Header header_;
    BrickTable bricks_;
    std::shared_ptr<Buffer> buffer_;
};

} // namespace vkt
