// Windows into voxel memory, indexed by absolute voxel coordinates, so that slabs, bricks and volumes look alike.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <type_traits>

namespace vkt {

/// Where bytes can be dereferenced.
enum class Space : std::uint8_t { host, device };

/// Typed window: data points at voxel `lower`; row and slice are strides in voxels.
template <class T> struct View {
    T* data = nullptr;
    Index3 lower;
    std::int64_t row = 0, slice = 0;

    [[gnu::always_inline]] constexpr T& operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return data[(x - lower.x) + (y - lower.y) * row + (z - lower.z) * slice];
    }
};

/// Untyped window over a box of voxels. Byte is std::byte or std::byte const.
template <class Byte> struct BasicView {
    Byte* data = nullptr;
    DataType type = DataType::uint8;
    Box box;
    std::int64_t row = 0, slice = 0; ///< strides in voxels
    Space space = Space::host;

    Index3 dims() const { return box.dims(); }
    [[gnu::always_inline]] Byte* at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return data + static_cast<std::int64_t>(size_of(type)) *
                          ((x - box.lower.x) + (y - box.lower.y) * row + (z - box.lower.z) * slice);
    }
    /// The part of this window that covers `part`, which must lie inside box.
    BasicView part(Box const& part) const {
        return {at(part.lower.x, part.lower.y, part.lower.z), type, part, row, slice, space};
    }
    /// The same memory seen with its lower corner at another voxel.
    BasicView moved_to(Index3 lower) const { return {data, type, {lower, lower + dims()}, row, slice, space}; }
    bool contiguous() const { return row == dims().x && slice == row * dims().y; }
    [[gnu::always_inline]] std::size_t bytes() const { return static_cast<std::size_t>(box.voxels()) * size_of(type); }

    template <class T> auto as() const {
        using Element = std::conditional_t<std::is_const_v<Byte>, T const, T>;
        return View<Element>{reinterpret_cast<Element*>(data), box.lower, row, slice};
    }
    operator BasicView<std::byte const>() const requires(!std::is_const_v<Byte>) {
        return {data, type, box, row, slice, space};
    }
};

using AnyView = BasicView<std::byte>;
using ConstView = BasicView<std::byte const>;

/// A dense view over memory that holds exactly the voxels of `box`, x fastest.
template <class Byte> BasicView<Byte> dense_view(Byte* data, DataType type, Box const& box, Space space = Space::host) {
    return {data, type, box, box.dims().x, box.dims().x * box.dims().y, space};
}

/// Copies voxels between host views of equal type and box dims (their lower corners may differ).
void copy(ConstView from, AnyView to);

} // namespace vkt
