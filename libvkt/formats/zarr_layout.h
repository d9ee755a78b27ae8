// What the dimensions of a Zarr array are in volumes: axes of space, or numbers of volumes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/formats/zarr_image.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vkt::zarr {

class Layout {
public:
    /// By the names of dimensions, else the last three.
    explicit Layout(Found const& found);

    /// Which dimension is x, y, z (-1: none).
    std::array<int, 3> const& axes() const { return axes_; }
    /// Dimensions that enumerate volumes, the first one slowest.
    std::vector<std::size_t> const& leading() const { return leading_; }
    std::int64_t volumes() const { return volumes_; }
    /// Voxels of what is encoded by itself, along x, y and z; and of a file.
    Index3 chunk() const { return extent_of(inner_); }
    Index3 file() const { return extent_of(file_); }
    /// Voxels from one to the next along an axis, within a chunk.
    std::int64_t stride(std::size_t axis) const {
        return axes_[axis] < 0 ? 0 : strides_[static_cast<std::size_t>(axes_[axis])];
    }
    /// Rows, slices and volumes of a chunk follow one another as those of a volume do.
    bool dense() const;

    /// A volume: its position along the leading dimensions, 0 elsewhere, and where it begins in chunks that hold
    /// several, in voxels.
    struct Place {
        Position at;
        std::int64_t offset = 0;
    };
    Place place(std::int64_t volume) const;
    /// Of the chunk with this number along each axis, which has voxels of a volume; and of the file.
    Position position(Place const& volume, Index3 chunk) const { return position_of(volume, chunk, inner_); }
    Position file_position(Place const& volume, Index3 file) const { return position_of(volume, file, file_); }

private:
    Index3 extent_of(Position const& all) const;
    Position position_of(Place const& volume, Index3 number, Position const& extents) const;

    std::array<int, 3> axes_{-1, -1, -1};
    std::vector<std::size_t> leading_;
    std::int64_t volumes_ = 1;
    Position shape_, inner_, file_;
    std::vector<std::int64_t> strides_; ///< of each dimension in a chunk, in voxels
};

} // namespace vkt::zarr
