// Bricks from memory or from a reader.
// SPDX-License-Identifier: MIT
#include "libvkt/core/brick_sequence.h"

#include <utility>

namespace vkt {

BrickSequence::BrickSequence(Volume volume) : whole_(std::move(volume)) {}

BrickSequence::BrickSequence(Header header, std::vector<Brick> bricks, Reader read)
    : header_(with_counts(std::move(header), bricks)), bricks_(std::move(bricks)), read_(std::move(read)) {}

std::byte const* BrickSequence::cells(std::size_t first, std::size_t count) {
    if (whole_)
        return whole_->buffer().read(Space::host) +
               static_cast<std::size_t>(whole_->brick_offset(first)) * size_of(header().dtype);
    std::size_t bytes = 0;
    for (std::size_t i = first; i < first + count; ++i)
        bytes += static_cast<std::size_t>(bricks_[i].cells()) * size_of(header_.dtype);
    if (group_.bytes() < bytes) group_ = Buffer(bytes);
    std::byte* const to = group_.write(Space::host);
    read_(first, count, to);
    return to;
}

Volume BrickSequence::whole() && {
    if (whole_) return std::move(*whole_);
    std::size_t const count = bricks_.size();
    Volume volume(std::move(header_), std::move(bricks_));
    read_(0, count, volume.buffer().write(Space::host));
    return volume;
}

} // namespace vkt
