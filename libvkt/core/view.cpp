// Copies between host views.
// SPDX-License-Identifier: MIT
#include "libvkt/core/view.h"

#include "libvkt/core/error.h"

#include <cstring>

namespace vkt {

void copy(ConstView from, AnyView to) {
    if (from.type != to.type || !(from.dims() == to.dims()))
        throw Error(ErrorKind::failure, "copy between views of different shape or type");
    if (to.box.empty()) return;
    if (from.contiguous() && to.contiguous()) {
        std::memcpy(to.data, from.data, to.bytes());
        return;
    }
    Index3 const n = to.dims();
    std::size_t const size = size_of(to.type);
    bool const whole_slices = from.row == n.x && to.row == n.x;
    for (std::int64_t z = 0; z < n.z; ++z) {
        std::byte* d = to.data + static_cast<std::size_t>(z * to.slice) * size;
        std::byte const* s = from.data + static_cast<std::size_t>(z * from.slice) * size;
        if (whole_slices) {
            std::memcpy(d, s, static_cast<std::size_t>(n.x * n.y) * size);
            continue;
        }
        for (std::int64_t y = 0; y < n.y; ++y)
            std::memcpy(d + static_cast<std::size_t>(y * to.row) * size,
                        s + static_cast<std::size_t>(y * from.row) * size, static_cast<std::size_t>(n.x) * size);
    }
}

} // namespace vkt
