// Pad: rows copied where they lie in the volume, voxel by voxel beside it.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/pad.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace VKT_BACKEND {

void pad_box(ConstView in, AnyView out, PadRule const& rule, Execution const& execution) {
    for_each_size(size_of(out.type), [&]<class U>(U) {
        U border;
        std::memcpy(&border, rule.border.data(), sizeof border);
        View<U const> const from = in.as<U>();
        View<U> const to = out.as<U>();
        bool const stream = driver::is_large(out);
        for_each_segment(execution, out.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
            U* const row = &to(x, y, z);
            std::int64_t const source_y = fold(y - rule.below.y, rule.dims.y, rule.boundary),
                               source_z = fold(z - rule.below.z, rule.dims.z, rule.boundary);
            if (source_y < 0 || source_z < 0) {
                std::fill_n(row, n, border);
                return;
            }
            std::int64_t const first = x - rule.below.x;
            std::int64_t const begin = std::clamp<std::int64_t>(-first, 0, n),
                               end = std::clamp(rule.dims.x - first, begin, n);
            auto const beside = [&](std::int64_t i) {
                std::int64_t const source_x = fold(first + i, rule.dims.x, rule.boundary);
                row[i] = source_x < 0 ? border : from(source_x, source_y, source_z);
            };
            for (std::int64_t i = 0; i < begin; ++i) beside(i);
            if (begin < end)
                driver::copy_forward(row + begin, &from(first + begin, source_y, source_z), end - begin, stream);
            for (std::int64_t i = end; i < n; ++i) beside(i);
        });
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
