// column_stencil on a GPU: every lane makes the column of its voxels, and has those beside it from its neighbours.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_stencil.h"
#include "libvkt/kernel/cuda_voxels.h"

#include <type_traits>

namespace vkt::VKT_BACKEND {

namespace driver {

/// A warp a row of a block, which goes through slices.
constexpr int column_rows = 8, column_slices = 32;

/// What compilers compare in one instruction.
template <class C> using Compared = std::conditional_t<std::is_integral_v<C> && (sizeof(C) < 4), int, C>;

/// Voxels around the middle of a column, [dz][dy].
template <class V, int radius, int radius_z> struct ColumnWindow {
    using Value = V;
    V values[2 * radius_z + 1][2 * radius + 1];
    __device__ __forceinline__ V operator()(int, int dy, int dz) const { return values[dz + radius_z][dy + radius]; }
};
/// What is made of the columns around a voxel.
template <class V, int radius, int columns> struct ColumnsAround {
    using Value = V;
    V values[(2 * radius + 1) * columns];
    __device__ __forceinline__ V operator()(int dx, int which) const { return values[(dx + radius) * columns + which]; }
};

template <class C, class F>
__global__ void __launch_bounds__(32 * column_rows)
    columns_kernel(DeviceRows in, DeviceRows out, Index3 n, unsigned across, unsigned along, F f,
                   unsigned long long* totals) {
    using V = Compared<C>;
    constexpr int radius = F::radius, radius_z = F::radius_z, inner = 32 - 2 * radius;
    constexpr int edge = 2 * radius + 1, deep = 2 * radius_z + 1;
    int const lane = static_cast<int>(threadIdx.x);
    std::int64_t const x = static_cast<std::int64_t>(blockIdx.x % across) * inner + lane - radius,
                       y = static_cast<std::int64_t>(blockIdx.x / across % along) * column_rows + threadIdx.y,
                       z0 = static_cast<std::int64_t>(blockIdx.x / across / along) * column_slices;
    LossCounts counts;
    if (y < n.y) { // the whole warp
        std::int64_t const end = z0 + column_slices < n.z ? z0 + column_slices : n.z;
        bool const stores = lane >= radius && lane < 32 - radius && x < n.x;
        std::byte const* from = in.at(x < n.x + radius ? x : n.x + radius - 1, y - radius, z0 - radius_z);
        auto const march = [&]<class T>() {
            ColumnWindow<V, radius, radius_z> window;
            for (std::int64_t z = z0 - radius_z; z < end + radius_z; ++z, from += in.slice) {
#pragma unroll
                for (int k = 0; k + 1 < deep; ++k)
#pragma unroll
                    for (int j = 0; j < edge; ++j) window.values[k][j] = window.values[k + 1][j];
#pragma unroll
                for (int j = 0; j < edge; ++j)
                    window.values[deep - 1][j] = neighbour_of<C, T>(reinterpret_cast<T const*>(from + j * in.row));
                if (z < z0 + radius_z) continue;
                V own[F::columns];
                f.column(window, own);
                ColumnsAround<V, radius, F::columns> made;
#pragma unroll
                for (int dx = -radius; dx <= radius; ++dx)
#pragma unroll
                    for (int k = 0; k < F::columns; ++k)
                        made.values[(dx + radius) * F::columns + k] =
                            dx == 0 ? own[k] : __shfl_sync(~0u, own[k], lane + dx);
                auto const result = static_cast<C>(f.combine(made));
                if (stores) store_result(out.type, out.at(x, y, z - radius_z), result, counts);
            }
        };
        with_type(in.type, [&]<class T>(T) {
            if constexpr (std::is_floating_point_v<C> || sizeof(T) == sizeof(C)) march.template operator()<T>();
        });
    }
    add_counts(counts, totals);
}

} // namespace driver

template <class C, class F>
void column_stencil(Execution const&, AnyView out, Losses& losses, Index3, F const& f, ConstView in) {
    if (out.box.empty()) return;
    Index3 const n = out.dims();
    using Shape = driver::BlockShape<32 - 2 * F::radius, driver::column_rows, driver::column_slices, 1>;
    driver::Blocks const blocks = driver::blocks_of<Shape>(n);
    driver::DeviceLosses const counts;
    driver::columns_kernel<C><<<blocks.all, dim3(32, driver::column_rows)>>>(
        driver::device_rows(in, out.box), driver::device_rows(ConstView(out), out.box), n, blocks.across, blocks.along,
        f, counts.get());
    check_launch("column_stencil");
    counts.add_to(losses);
}

} // namespace vkt::VKT_BACKEND
