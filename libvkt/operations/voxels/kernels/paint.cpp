// Painting: whole registers, beyond the end of a run too; the next one covers what is too much.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/paint.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace VKT_BACKEND {

void paint_row(std::span<std::int32_t const> edges, std::uint32_t const* names, AnyView row, Execution const&) {
    for_each_size(size_of(row.type), [&]<class T>(T) {
        constexpr std::int64_t lanes = Register<T>::lanes, piece = 2048;
        alignas(64) T buffer[piece + lanes];
        auto const count = static_cast<std::int64_t>(edges.size());
        std::int64_t edge = 0; // the next one
        while (edge < count && edges[static_cast<std::size_t>(edge)] <= row.box.lower.x) ++edge;
        for (std::int64_t begin = row.box.lower.x; begin < row.box.upper.x; begin += piece) {
            std::int64_t const n = begin + piece < row.box.upper.x ? piece : row.box.upper.x - begin;
            std::int64_t x = 0;
            while (x < n) {
                std::int64_t end = n;
                if (edge < count && edges[static_cast<std::size_t>(edge)] - begin < n)
                    end = edges[static_cast<std::size_t>(edge)] - begin;
                T const label = edge % 2 != 0 ? static_cast<T>(names[edge / 2]) : T(0);
                typename Register<T>::type const labels = typename Register<T>::type{} + label;
                for (; x < end; x += lanes) std::memcpy(buffer + x, &labels, sizeof labels);
                x = end;
                if (end < n) ++edge;
            }
            // An edge at the end of the piece is that of the next.
            while (edge < count && edges[static_cast<std::size_t>(edge)] <= begin + n) ++edge;
            stream_bytes(row.at(begin, row.box.lower.y, row.box.lower.z), reinterpret_cast<std::byte const*>(buffer),
                         static_cast<std::size_t>(n) * sizeof(T));
        }
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
