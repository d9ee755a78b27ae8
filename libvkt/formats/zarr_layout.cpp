// Axes and strides.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_layout.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/coordinates.h"

#include <algorithm>
#include <string>

namespace vkt::zarr {
namespace {

std::array<int, 3> spatial_axes(Found const& found) {
    auto const rank = static_cast<int>(found.array.shape.size());
    std::vector<std::string> const& names =
        found.image && std::ssize(found.image->names) == rank ? found.image->names : found.array.names;
    std::array<int, 3> axes{-1, -1, -1};
    if (std::ssize(names) == rank)
        for (int k = 0; k < rank; ++k)
            for (std::size_t a = 0; a < 3; ++a)
                if (lower_case(names[static_cast<std::size_t>(k)]) == std::string(1, "xyz"[a])) axes[a] = k;
    if (axes[0] >= 0 && axes[1] >= 0) return axes;
    // The last ones, but for those that enumerate volumes.
    axes = {-1, -1, -1};
    std::size_t next = 0;
    for (int k = rank - 1; k >= 0 && next < 3; --k)
        if (std::ssize(names) != rank || !enumerates(names[static_cast<std::size_t>(k)])) axes[next++] = k;
    if (next == 0) axes[0] = rank - 1;
    return axes;
}

} // namespace

Layout::Layout(Found const& found)
    : axes_(spatial_axes(found)), shape_(found.array.shape), inner_(found.array.inner), file_(found.array.chunk),
      strides_(found.array.shape.size()) {
    std::int64_t stride = 1;
    for (std::size_t i = found.array.order.size(); i-- > 0;) {
        strides_[found.array.order[i]] = stride;
        stride *= inner_[found.array.order[i]];
    }
    for (std::size_t k = 0; k < shape_.size(); ++k)
        if (std::find(axes_.begin(), axes_.end(), static_cast<int>(k)) == axes_.end()) {
            leading_.push_back(k);
            volumes_ *= shape_[k];
        }
}

Index3 Layout::extent_of(Position const& all) const {
    Index3 extent{1, 1, 1};
    for (int a = 0; a < 3; ++a)
        if (int const k = axes_[static_cast<std::size_t>(a)]; k >= 0) extent[a] = all[static_cast<std::size_t>(k)];
    return extent;
}

bool Layout::dense() const {
    Index3 const n = chunk();
    return stride(0) == 1 && (axes_[1] < 0 || stride(1) == n.x) && (axes_[2] < 0 || stride(2) == n.x * n.y);
}

Layout::Place Layout::place(std::int64_t volume) const {
    Place place{Position(shape_.size(), 0), 0};
    for (std::size_t i = leading_.size(); i-- > 0;) {
        std::size_t const k = leading_[i];
        place.at[k] = volume % shape_[k];
        volume /= shape_[k];
        place.offset += place.at[k] % inner_[k] * strides_[k];
    }
    return place;
}

Position Layout::position_of(Place const& volume, Index3 number, Position const& extents) const {
    Position position = volume.at;
    for (std::size_t const k : leading_) position[k] /= extents[k];
    for (int a = 0; a < 3; ++a)
        if (int const k = axes_[static_cast<std::size_t>(a)]; k >= 0) position[static_cast<std::size_t>(k)] = number[a];
    return position;
}

} // namespace vkt::zarr
