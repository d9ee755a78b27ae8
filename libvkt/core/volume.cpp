// Volumes in memory.
// SPDX-License-Identifier: MIT
#include "libvkt/core/volume.h"

#include "libvkt/core/error.h"

#include <algorithm>

namespace vkt {

namespace {

BrickTable one_brick(Index3 dims) { return {dims, std::vector<Brick>{{{0, 0, 0}, dims, 0}}}; }

} // namespace

Volume::Volume(Header header) : header_(std::move(header)), bricks_(one_brick(header_.dims)) {
    if (header_.kind != Kind::structured) throw Error(ErrorKind::failure, "a hierarchical volume needs its bricks");
    check(header_);
    buffer_ = std::make_shared<Buffer>(header_.bytes());
}

Volume::Volume(Header header, Buffer voxels) : header_(std::move(header)), bricks_(one_brick(header_.dims)) {
    if (header_.kind != Kind::structured || voxels.bytes() < header_.bytes())
        throw Error(ErrorKind::failure, "the voxels do not fit the header of a structured volume");
    check(header_);
    buffer_ = std::make_shared<Buffer>(std::move(voxels));
}

Header with_counts(Header header, BrickTable const& bricks) {
    header.kind = Kind::hierarchical;
    header.brick_count = static_cast<std::int64_t>(bricks.size());
    header.cell_count = 0;
    header.level_count = 1;
    for (Brick const& brick : bricks) {
        header.cell_count += brick.cells();
        header.level_count = std::max(header.level_count, brick.level + 1);
    }
    check(header);
    return header;
}

Volume::Volume(Header header, std::vector<Brick> bricks)
    : header_(with_counts(std::move(header), bricks)), bricks_(header_.dims, std::move(bricks)),
      buffer_(std::make_shared<Buffer>(header_.bytes())) {}

Volume::Volume(Header header, BrickTable const& bricks)
    : header_(with_counts(std::move(header), bricks)), bricks_(bricks.kept(header_.dims)),
      buffer_(std::make_shared<Buffer>(header_.bytes())) {}

Volume::Volume(Header header, BrickTable const& bricks, Buffer cells)
    : header_(with_counts(std::move(header), bricks)), bricks_(bricks.kept(header_.dims)) {
    if (cells.bytes() < header_.bytes())
        throw Error(ErrorKind::failure, "the cells do not fit the bricks of a hierarchical volume");
    buffer_ = std::make_shared<Buffer>(std::move(cells));
}

ConstView Volume::brick_view(std::size_t i) const {
    std::byte const* const data = buffer_->read(Space::host);
    return dense_view(data + static_cast<std::size_t>(brick_offset(i)) * size_of(header_.dtype), header_.dtype,
                      box_of(bricks_[i].dims));
}

AnyView Volume::mutable_brick_view(std::size_t i) {
    std::byte* const data = buffer_->update(Space::host);
    return dense_view(data + static_cast<std::size_t>(brick_offset(i)) * size_of(header_.dtype), header_.dtype,
                      box_of(bricks_[i].dims));
}

} // namespace vkt
