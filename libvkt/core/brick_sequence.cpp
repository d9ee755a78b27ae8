// Bricks from memory or from a reader.
// SPDX-License-Identifier: MIT
#include "libvkt/core/brick_sequence.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace vkt {

BrickSequence::BrickSequence(Volume volume) : whole_(std::move(volume)) {}

BrickSequence::BrickSequence(Header header, std::vector<Brick> bricks, Reader read, BrickOrder order)
    : read_(std::move(read)), order_(order) {
    header_ = with_counts(std::move(header), bricks);
    bricks_ = BrickTable(header_.dims, std::move(bricks));
}

BrickSequence::BrickSequence(Header header, BrickTable const& bricks, Reader read, BrickOrder order)
    : header_(with_counts(std::move(header), bricks)), bricks_(bricks.kept(header_.dims)), read_(std::move(read)),
      order_(order) {}

std::size_t BrickSequence::largest_brick() const {
    std::int64_t most = 0;
    for (Brick const& brick : bricks()) most = std::max(most, brick.cells());
    return static_cast<std::size_t>(most) * size_of(header().dtype);
}

std::size_t BrickSequence::group(std::size_t first, std::size_t bytes) const {
    BrickTable const& all = bricks();
    std::size_t end = first, held = 0;
    while (end < all.size()) {
        held += static_cast<std::size_t>(all[end].cells()) * size_of(header().dtype);
        if (end > first && held > bytes) break;
        ++end;
    }
    return end - first;
}

std::byte const* BrickSequence::cells(std::size_t first, std::size_t count) {
    if (count == 0) return nullptr;
    if (whole_)
        return whole_->buffer().read(Space::host) +
               static_cast<std::size_t>(whole_->brick_offset(first)) * size_of(header().dtype);
    std::size_t const bytes = bytes_of(first, count);
    if (group_.bytes() < bytes) group_ = Buffer(bytes);
    std::byte* const to = group_.write(Space::host);
    read_(first, count, to);
    return to;
}

void BrickSequence::read(std::size_t first, std::size_t count, std::byte* to) {
    if (count == 0) return;
    if (whole_)
        std::memcpy(to, cells(first, count), bytes_of(first, count));
    else
        read_(first, count, to);
}

Volume BrickSequence::whole() && {
    if (whole_) return std::move(*whole_);
    Volume volume(header_, bricks_);
    std::byte* to = volume.buffer().write(Space::host);
    // In groups: a reader that makes the bricks of others holds as many of those.
    for (std::size_t first = 0, n = 0; first < bricks_.size(); first += n) {
        n = group(first, group_bytes_);
        read_(first, n, to);
        to += bytes_of(first, n);
    }
    return volume;
}

BrickSequence BrickSequence::with_header(Header header) && {
    BrickSequence result = std::move(*this);
    (result.whole_ ? result.whole_->header() : result.header_) = with_counts(std::move(header), result.bricks());
    return result;
}

} // namespace vkt
