// Work on a GPU that is a function of a voxel's place: a thread a few voxels of a row.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_packs.h"

#include <type_traits>
#include <vector>

namespace vkt::VKT_BACKEND {

namespace driver {

/// Voxels of a block of threads: x by y by z of them at a time, which go on along the rows `strips` times, so that what
/// depends on the row alone is computed once.
template <int X, int Y, int Z, int Strips> struct BlockShape {
    static constexpr int x = X, y = Y, z = Z, strips = Strips, width = X * Strips;
};
/// A warp a row.
using RowBlock = BlockShape<32, 8, 1, 4>;
/// Warps of 8 by 4 voxels, for functions that look at voxels elsewhere, along slanted rows: they meet fewer lines of
/// the cache there.
using SlantedBlock = BlockShape<8, 4, 8, 8>;

/// Blocks of threads along x and y, and in all.
struct Blocks {
    unsigned across, along, all;
};

template <class Shape> Blocks blocks_of(Index3 n) {
    std::int64_t const across = (n.x + Shape::width - 1) / Shape::width, along = (n.y + Shape::y - 1) / Shape::y,
                       deep = (n.z + Shape::z - 1) / Shape::z;
    return {launch_blocks(across), launch_blocks(along), launch_blocks(across, along, deep)};
}

/// Blocks that a multiprocessor is to have room for at once: a functor's own word, `static constexpr int
/// blocks_at_once`. What waits for memory wants many, which leaves a thread fewer registers.
template <class F> constexpr int blocks_at_once() {
    if constexpr (requires { F::blocks_at_once; })
        return F::blocks_at_once;
    else
        return 1;
}

template <class Shape, class F>
__global__ void __launch_bounds__(Shape::x* Shape::y* Shape::z, blocks_at_once<F>())
    voxels_kernel(Blocks blocks, Index3 n, __grid_constant__ F const f, unsigned long long* totals) {
    std::int64_t const x0 = static_cast<std::int64_t>(blockIdx.x % blocks.across) * Shape::width + threadIdx.x,
                       y = static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * Shape::y +
                           threadIdx.y,
                       z = static_cast<std::int64_t>(blockIdx.x / blocks.across / blocks.along) * Shape::z +
                           threadIdx.z;
    LossCounts counts;
    if (y < n.y && z < n.z)
        for (std::int64_t x = x0; x < n.x && x < x0 + Shape::width; x += Shape::x) f(x, y, z, counts);
    if (totals != nullptr) add_counts(counts, totals);
}

/// Calls f(x, y, z, counts) for 0 <= x < n.x, … on the device; `totals` may be null where nothing is counted.
template <class Shape = RowBlock, class F>
void for_each_voxel(Index3 n, F const& f, unsigned long long* totals, char const* name) {
    if (n.x <= 0 || n.y <= 0 || n.z <= 0) return;
    Blocks const blocks = blocks_of<Shape>(n);
    voxels_kernel<Shape, F><<<blocks.all, dim3(Shape::x, Shape::y, Shape::z)>>>(blocks, n, f, totals);
    check_launch(name);
}

/// What a list holds, in device memory for the time of one call.
template <class T> class DeviceList {
public:
    explicit DeviceList(std::vector<T> const& values) : memory_(values.size() * sizeof(T)) {
        static_assert(std::is_trivially_copyable_v<T>);
        if (!values.empty()) copy_to_device(memory_.get(), values.data(), values.size() * sizeof(T));
    }
    T const* get() const { return reinterpret_cast<T const*>(memory_.get()); }

private:
    DeviceScratch memory_;
};

} // namespace driver

} // namespace vkt::VKT_BACKEND
