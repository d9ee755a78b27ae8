// Volumes in memory.
// SPDX-License-Identifier: MIT
#include "libvkt/core/volume.h"

#include "libvkt/core/error.h"

#include <algorithm>

namespace vkt {

Volume::Volume(Header header) : header_(std::move(header)), bricks_{Brick{{0, 0, 0}, header_.dims, 0}}, offsets_{0} {
    if (header_.kind != Kind::structured) throw Error(ErrorKind::failure, "a hierarchical volume needs its bricks");
    check(header_);
    buffer_ = std::make_shared<Buffer>(header_.bytes());
}

Volume::Volume(Header header, Buffer voxels)
    : header_(std::move(header)), bricks_{Brick{{0, 0, 0}, header_.dims, 0}}, offsets_{0} {
    if (header_.kind != Kind::structured || voxels.bytes() < header_.bytes())
        throw Error(ErrorKind::failure, "the voxels do not fit the header of a structured volume");
    check(header_);
    buffer_ = std::make_shared<Buffer>(std::move(voxels));
}

Header with_counts(Header header, std::span<Brick const> bricks) {
    header.kind = Kind::hierarchical;
    header.brick_count = static_cast<std::int64_t>(bricks.size());
    header.cell_count = 0;
    header.level_count = 1;
    for (auto const& brick : bricks) {
        header.cell_count += brick.cells();
        header.level_count = std::max(header.level_count, brick.level + 1);
    }
    check(header);
    return header;
}

Volume::Volume(Header header, std::vector<Brick> bricks)
    : header_(with_counts(std::move(header), bricks)), bricks_(std::move(bricks)) {
    place_bricks();
    buffer_ = std::make_shared<Buffer>(header_.bytes());
}

Volume::Volume(Header header, std::vector<Brick> bricks, Buffer cells)
    : header_(with_counts(std::move(header), bricks)), bricks_(std::move(bricks)) {
    if (cells.bytes() < header_.bytes())
        throw Error(ErrorKind::failure, "the cells do not fit the bricks of a hierarchical volume");
    place_bricks();
    buffer_ = std::make_shared<Buffer>(std::move(cells));
}

void Volume::place_bricks() {
    offsets_.reserve(bricks_.size());
    std::int64_t offset = 0;
    for (auto const& brick : bricks_) {
        offsets_.push_back(offset);
        offset += brick.cells();
    }
}

ConstView Volume::brick_view(std::size_t i) const {
    std::byte const* const data = buffer_->read(Space::host);
    return dense_view(data + static_cast<std::size_t>(offsets_[i]) * size_of(header_.dtype), header_.dtype,
                      box_of(bricks_[i].dims));
}

AnyView Volume::mutable_brick_view(std::size_t i) {
    std::byte* const data = buffer_->update(Space::host);
    return dense_view(data + static_cast<std::size_t>(offsets_[i]) * size_of(header_.dtype), header_.dtype,
                      box_of(bricks_[i].dims));
}

} // namespace vkt
