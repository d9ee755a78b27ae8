// Numbers of voxels that grow from slab to slab, in the memory of whoever counts.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace vkt {

/// A list of counters. On a GPU they stay there until they are asked for.
class VoxelCounts {
public:
    VoxelCounts() = default;
    explicit VoxelCounts(std::size_t size) : size_(size) {}

    std::size_t size() const { return size_; }
    /// To be added to there; zero at first. Throws Error{resources}.
    std::uint64_t* update(Space space);
    /// What was counted, there.
    std::uint64_t const* read(Space space);
    std::span<std::uint64_t const> read() { return {read(Space::host), size_}; }

private:
    std::size_t size_ = 0;
    Buffer buffer_;
    bool begun_ = false; ///< else there is nothing in the buffer
};

} // namespace vkt
