// Bricks from memory or from a reader.
// SPDX-License-Identifier: MIT
#include "libvkt/core/brick_sequence.h"

#include "libvkt/core/device.h"

#include <algorithm>
#include <utility>

namespace vkt {

namespace {

/// What does not leave room for results goes there in groups.
bool fits_on_device(std::size_t bytes) { return bytes <= device_facts(device_current()).free / 4; }

} // namespace

BrickSequence::BrickSequence(Volume volume) : whole_(std::move(volume)) {}

BrickSequence::BrickSequence(Header header, std::vector<Brick> bricks, Reader read, BrickOrder order, Space space)
    : read_(std::move(read)), order_(order), space_(space) {
    header_ = with_counts(std::move(header), bricks);
    bricks_ = BrickTable(header_.dims, std::move(bricks));
}

BrickSequence::BrickSequence(Header header, BrickTable const& bricks, Reader read, BrickOrder order, Space space)
    : header_(with_counts(std::move(header), bricks)), bricks_(bricks.kept(header_.dims)), read_(std::move(read)),
      order_(order), space_(space) {}

Space BrickSequence::space() const {
    if (!whole_) return space_;
    return whole_->buffer().resident(Space::host) ? Space::host : Space::device;
}

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

std::byte const* BrickSequence::cells(std::size_t first, std::size_t count, Space space) {
    if (count == 0) return nullptr;
    if (whole_ &&
        (whole_->buffer().resident(space) || space == Space::host || fits_on_device(whole_->buffer().bytes())))
        return whole_->buffer().read(space) +
               static_cast<std::size_t>(whole_->brick_offset(first)) * size_of(header().dtype);
    std::size_t const bytes = bytes_of(first, count);
    if (group_.bytes() < bytes) group_ = Buffer(bytes);
    Space const comes = this->space();
    std::byte* const to = group_.write(comes);
    read(first, count, to, comes);
    return group_.read(space);
}

void BrickSequence::read(std::size_t first, std::size_t count, std::byte* to, Space space) {
    if (count == 0) return;
    if (!whole_ && space == space_) return read_(first, count, to);
    std::size_t const bytes = bytes_of(first, count);
    Space const comes = this->space();
    std::byte const* const from = cells(first, count, comes);
    copy_between(to, space, from, comes, bytes);
}

Volume BrickSequence::whole() && {
    if (whole_) return std::move(*whole_);
    Volume volume(header_, bricks_);
    std::byte* to = volume.buffer().write(space_);
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
