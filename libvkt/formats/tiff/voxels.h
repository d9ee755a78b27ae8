// TIFF: the voxels of a plane, out of the strips or tiles of its page.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/tiff/layout.h"
#include "libvkt/formats/tiff/pages.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vkt::tiff {

/// Reads planes, and keeps the strip or tile that was decoded last.
class PlaneReader {
public:
    /// The voxels of a box's x and y, as that type. Throws Error{data} for what cannot be decoded.
    void read(Pages& pages, Plane const& plane, DataType type, Box const& box, std::byte* slice);

private:
    std::byte const* unit(Pages const& pages, std::size_t page, std::uint32_t index, std::size_t bytes);

    std::size_t held_page_ = static_cast<std::size_t>(-1);
    std::uint32_t held_unit_ = 0;
    std::vector<std::byte> held_; ///< a strip or tile, decoded
};

} // namespace vkt::tiff
