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

Volume::Volume(Header header, std::vector<Brick> bricks) : header_(std::move(header)), bricks_(std::move(bricks)) {
    header_.kind = Kind::hierarchical;
    header_.brick_count = static_cast<std::int64_t>(bricks_.size());
    header_.cell_count = 0;
    header_.level_count = 1;
    offsets_.reserve(bricks_.size());
    for (auto const& brick : bricks_) {
        offsets_.push_back(header_.cell_count);
        header_.cell_count += brick.cells();
        header_.level_count = std::max(header_.level_count, brick.level + 1);
    }
    check(header_);
    buffer_ = std::make_shared<Buffer>(header_.bytes());
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
