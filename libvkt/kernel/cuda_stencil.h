// stencil and column_stencil on a GPU: a block's voxels and their neighbours in shared memory, or, of far ones, in a
// copy.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/order.h"

namespace vkt::VKT_BACKEND {

namespace driver {

/// A voxel as C, or its key where C is an integer.
template <class C, class T> __device__ __forceinline__ C neighbour_of(T const* from) {
    if constexpr (std::is_floating_point_v<C>)
        return as_compute<C>(*from);
    else if constexpr (sizeof(T) == sizeof(C))
        return to_key<T>(*reinterpret_cast<C const*>(from));
    else
        return C{};
}
template <class C> __device__ __forceinline__ C load_neighbour(DataType type, std::byte const* from) {
    C value{};
    with_type(type, [&]<class T>(T) { value = neighbour_of<C, T>(reinterpret_cast<T const*>(from)); });
    return value;
}
template <class C>
__device__ __forceinline__ void store_result(DataType type, std::byte* to, C value, LossCounts& counts) {
    if constexpr (std::is_floating_point_v<C>) {
        store_value(type, to, value, counts);
    } else {
        with_type(type, [&]<class T>(T) {
            if constexpr (sizeof(T) == sizeof(C)) *reinterpret_cast<C*>(to) = from_key<T>(value);
        });
    }
}

} // namespace driver

/// The neighbours of one voxel.
template <class C> class Window {
public:
    using Value = C;
    __device__ __forceinline__ Window(C const* centre, int row, int slice)
        : centre_(centre), row_(row), slice_(slice) {}
    __device__ __forceinline__ C operator()(int dx, int dy, int dz) const {
        return centre_[dx + dy * row_ + dz * slice_];
    }

private:
    C const* centre_;
    int row_, slice_;
};

namespace driver {

inline constexpr int tile_x = 32, tile_y = 8;

struct Tiles {
    int deep, across, along; ///< slices a block; blocks in x and y
    int rx, ry, rz;
};

template <class C, class F>
__global__ void __launch_bounds__(tile_x* tile_y)
    stencil_any(DeviceRows in, DeviceRows out, Index3 dims, Tiles tiles, F f, unsigned long long* totals) {
    extern __shared__ __align__(16) unsigned char memory[];
    C* const values = reinterpret_cast<C*>(memory);
    int const wide = tile_x + 2 * tiles.rx, high = tile_y + 2 * tiles.ry, slice = wide * high;
    std::int64_t const x0 = static_cast<std::int64_t>(blockIdx.x % tiles.across) * tile_x;
    std::int64_t const y0 = static_cast<std::int64_t>(blockIdx.x / tiles.across % tiles.along) * tile_y;
    std::int64_t const z0 = static_cast<std::int64_t>(blockIdx.x / tiles.across / tiles.along) * tiles.deep;
    int const deep = static_cast<int>(dims.z - z0 < tiles.deep ? dims.z - z0 : tiles.deep);
    // A warp a row. The last blocks reach beyond: neighbours that no voxel of theirs has need not be read.
    int const right = static_cast<int>(dims.x - x0 < tile_x ? dims.x - x0 : tile_x) + 2 * tiles.rx;
    with_type(in.type, [&]<class T>(T) {
        for (int row = static_cast<int>(threadIdx.y); row < high * (deep + 2 * tiles.rz); row += tile_y) {
            int const k = row / high, j = row - k * high;
            std::int64_t const gy = y0 + j - tiles.ry;
            if (gy >= dims.y + tiles.ry) continue;
            auto const* const from = reinterpret_cast<T const*>(in.at(x0 - tiles.rx, gy, z0 + k - tiles.rz));
            for (int x = static_cast<int>(threadIdx.x); x < right; x += tile_x)
                values[row * wide + x] = neighbour_of<C, T>(from + x);
        }
    });
    __syncthreads();
    LossCounts counts;
    std::int64_t const x = x0 + threadIdx.x, y = y0 + threadIdx.y;
    if (x < dims.x && y < dims.y)
        for (int k = 0; k < deep; ++k) {
            C const* const centre = values + (k + tiles.rz) * slice +
                                    (static_cast<int>(threadIdx.y) + tiles.ry) * wide + static_cast<int>(threadIdx.x) +
                                    tiles.rx;
            store_result(out.type, out.at(x, y, z0 + k), f(Window<C>(centre, wide, slice)), counts);
        }
    add_counts(counts, totals);
}

} // namespace driver

namespace driver {

inline constexpr std::int64_t shared_memory = 200 << 10, comfortable_memory = 48 << 10;

/// The neighbours of a voxel in memory of any size.
template <class C> class FarWindow {
public:
    using Value = C;
    __device__ __forceinline__ FarWindow(C const* centre, std::int64_t row, std::int64_t slice)
        : centre_(centre), row_(row), slice_(slice) {}
    __device__ __forceinline__ C operator()(int dx, int dy, int dz) const {
        return centre_[dx + dy * row_ + dz * slice_];
    }

private:
    C const* centre_;
    std::int64_t row_, slice_;
};

/// Voxels of a box as C, in one array.
template <class C> struct Widened {
    DeviceRows in;
    Index3 n;
    C* to;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z, LossCounts&) const {
        to[(z * n.y + y) * n.x + x] = load_neighbour<C>(in.type, in.at(x, y, z));
    }
};

/// A stencil on such voxels; `around` is the extent of all, `radius` how far they lie around the results.
template <class C, class F> struct FarStencil {
    F f;
    C const* values;
    Index3 around, radius;
    DeviceRows out;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               LossCounts& counts) const {
        std::int64_t const slice = around.x * around.y;
        C const* const centre = values + (z + radius.z) * slice + (y + radius.y) * around.x + x + radius.x;
        store_result(out.type, out.at(x, y, z), f(FarWindow<C>(centre, around.x, slice)), counts);
    }
};

template <class C, class F> void far_stencil(AnyView out, Losses& losses, Index3 radius, F const& f, ConstView in) {
    Box const around = grow(out.box, radius);
    Buffer memory(static_cast<std::size_t>(around.voxels()) * sizeof(C));
    auto* const values = reinterpret_cast<C*>(memory.write(Space::device));
    for_each_voxel(around.dims(), Widened<C>{device_rows(in, around), around.dims(), values}, nullptr,
                   "stencil, copying");
    DeviceLosses const counts;
    for_each_voxel(out.dims(), FarStencil<C, F>{f, values, around.dims(), radius, device_rows(ConstView(out), out.box)},
                   counts.get(), "stencil");
    counts.add_to(losses);
}

} // namespace driver

template <class C, class F>
void stencil(Execution const&, AnyView out, Losses& losses, Index3 radius, F const& f, ConstView in) {
    if (out.box.empty()) return;
    Index3 const n = out.dims();
    std::int64_t const plane = (driver::tile_x + 2 * radius.x) * (driver::tile_y + 2 * radius.y) *
                               static_cast<std::int64_t>(sizeof(C)); // bytes of a slice of a block's neighbourhood
    constexpr std::int64_t comfortable = driver::comfortable_memory;
    std::int64_t const room = plane * (2 * radius.z + 4) <= comfortable ? comfortable : driver::shared_memory;
    std::int64_t const deep = std::min<std::int64_t>(8, room / plane - 2 * radius.z);
    if (deep < 1) return driver::far_stencil<C>(out, losses, radius, f, in);
    driver::Tiles const tiles{static_cast<int>(deep),
                              static_cast<int>((n.x + driver::tile_x - 1) / driver::tile_x),
                              static_cast<int>((n.y + driver::tile_y - 1) / driver::tile_y),
                              static_cast<int>(radius.x),
                              static_cast<int>(radius.y),
                              static_cast<int>(radius.z)};
    unsigned const blocks = launch_blocks(tiles.across, tiles.along, (n.z + deep - 1) / deep);
    auto const bytes = static_cast<int>(plane * (deep + 2 * radius.z));
    if (bytes > comfortable &&
        cudaFuncSetAttribute(driver::stencil_any<C, F>, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes) !=
            cudaSuccess) {
        (void)cudaGetLastError(); // this GPU has less
        return driver::far_stencil<C>(out, losses, radius, f, in);
    }
    driver::DeviceLosses const counts;
    driver::stencil_any<C><<<blocks, dim3(driver::tile_x, driver::tile_y), bytes>>>(
        driver::device_rows(in, out.box), driver::device_rows(ConstView(out), out.box), n, tiles, f, counts.get());
    check_launch("stencil");
    counts.add_to(losses);
}

} // namespace vkt::VKT_BACKEND
