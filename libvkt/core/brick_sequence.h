// BrickSequence: a hierarchical volume whose cells come a few bricks at a time: from memory, a file, a pipe, or from an
// operation that computes them then.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"

#include <functional>
#include <optional>

namespace vkt {

/// In which order a sequence gives its cells: again and again, or each once, from the first brick to the last (leaving
/// some out is allowed, going back is not).
enum class BrickOrder : std::uint8_t { any, ascending };

/// Bytes of cells that are handed on at once, unless a single brick has more: they stay in the caches on their way.
inline constexpr std::size_t brick_group_bytes = std::size_t{4} << 20;

/// Header and tree are known from the start; cells are read when they are asked for, so that a volume of any size
/// passes in the memory of its table of bricks (4 to 57 bytes each) and of one group of them.
class BrickSequence {
public:
    /// Writes the cells of `count` bricks from the first on to `to`, dense, in the order of the bricks, where the
    /// sequence says that it does.
    using Reader = std::function<void(std::size_t first, std::size_t count, std::byte* to)>;

    /// Cells that lie in memory already.
    BrickSequence(Volume volume);
    /// Fills in the header's brick, cell and level counts.
    BrickSequence(Header header, std::vector<Brick> bricks, Reader read, BrickOrder order = BrickOrder::any,
                  Space space = Space::host);
    /// The same tree as another sequence.
    BrickSequence(Header header, BrickTable const& bricks, Reader read, BrickOrder order = BrickOrder::any,
                  Space space = Space::host);

    Header const& header() const { return whole_ ? whole_->header() : header_; }
    BrickTable const& bricks() const { return whole_ ? whole_->bricks() : bricks_; }
    BrickOrder order() const { return order_; }
    bool in_memory() const { return whole_.has_value(); }
    /// Where cells come: what is asked for elsewhere is copied there.
    Space space() const;
    /// Bytes of the largest brick's cells.
    std::size_t largest_brick() const;

    /// How many bytes of cells are best asked for at once.
    std::size_t group_bytes() const { return group_bytes_; }
    void set_group_bytes(std::size_t bytes) { group_bytes_ = bytes; }
    /// How many bricks from the first on hold no more than so many bytes together; at least one, if there is one.
    std::size_t group(std::size_t first, std::size_t bytes) const;

    /// The cells of `count` bricks, valid until the next call. Throws what the reader throws.
    std::byte const* cells(std::size_t first, std::size_t count, Space space = Space::host);
    /// The same, written to `to`, which lies there.
    void read(std::size_t first, std::size_t count, std::byte* to, Space space = Space::host);
    /// All of it, where cells come. The sequence is used up. O(cells), no copy if they lie in memory.
    Volume whole() &&;
    /// The same cells under another header of the same kind and type.
    BrickSequence with_header(Header header) &&;

private:
    std::size_t bytes_of(std::size_t first, std::size_t count) const {
        return static_cast<std::size_t>(bricks().cells(first, count)) * size_of(header().dtype);
    }

    Header header_;
    BrickTable bricks_;
    Reader read_;
    BrickOrder order_ = BrickOrder::any;
    Space space_ = Space::host;
    std::size_t group_bytes_ = brick_group_bytes;
    std::optional<Volume> whole_;
    Buffer group_;
};

} // namespace vkt
