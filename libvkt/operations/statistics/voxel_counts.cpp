// Counters that lie where voxels are counted.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/voxel_counts.h"

#include "libvkt/core/device.h"

#include <cstring>

namespace vkt {

std::uint64_t* VoxelCounts::update(Space space) {
    if (begun_) return reinterpret_cast<std::uint64_t*>(buffer_.update(space));
    std::size_t const bytes = size_ * sizeof(std::uint64_t);
    buffer_.reserve(bytes);
    std::byte* const data = buffer_.write(space);
    if (space == Space::device)
        device_clear(data, bytes);
    else
        std::memset(data, 0, bytes);
    begun_ = true;
    return reinterpret_cast<std::uint64_t*>(data);
}

std::uint64_t const* VoxelCounts::read(Space space) {
    if (!begun_) return update(space);
    return reinterpret_cast<std::uint64_t const*>(buffer_.read(space));
}

} // namespace vkt
