// Copying cells but for those of the background.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/foreground.h"

#include "libvkt/amr/cells.h"
#include "libvkt/kernel/numeric.h"

#include <type_traits>

namespace vkt {
namespace {

template <class T> bool equal(T a, T b) {
    if constexpr (std::is_integral_v<T>)
        return a == b;
    else
        return static_cast<double>(a) == static_cast<double>(b);
}

} // namespace

ConstView without_background(ConstView part, double background, std::vector<std::byte>& buffer) {
    buffer.resize(static_cast<std::size_t>(part.box.voxels()) * size_of(part.type));
    std::int64_t count = 0;
    with_type(part.type, [&]<class T>(T) {
        View<T const> const in = part.as<T>();
        T const hole = store_cell<T>(background);
        T* const kept = reinterpret_cast<T*>(buffer.data());
        Box const b = part.box;
        for (std::int64_t z = b.lower.z; z < b.upper.z; ++z)
            for (std::int64_t y = b.lower.y; y < b.upper.y; ++y)
                for (std::int64_t x = b.lower.x; x < b.upper.x; ++x) {
                    T const cell = in(x, y, z);
                    kept[count] = cell;
                    count += equal(cell, hole) ? 0 : 1;
                }
    });
    return dense_view(static_cast<std::byte const*>(buffer.data()), part.type, box_of({count, 1, 1}));
}

} // namespace vkt
