// Work on a GPU that is a function of a voxel's place: a thread a few voxels of a row.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_packs.h"

#include <type_traits>
#include <vector>

namespace vkt::VKT_BACKEND {

namespace driver {

/// Voxels of a block of threads: rows of a warp, which goes on along them, so that what depends on the row alone is
/// computed once.
inline constexpr int strip_x = 32, strip_y = 8, strips = 4;

struct Strips {
    unsigned across, along, blocks;
};

inline Strips strips_of(Index3 n) {
    std::int64_t const across = (n.x + strip_x * strips - 1) / (strip_x * strips),
                       along = (n.y + strip_y - 1) / strip_y;
    if (across > 0x7fffffff || along > 0x7fffffff / across || n.z > 0x7fffffff / (across * along))
        throw Error(ErrorKind::resources, "the volume is too large for one GPU launch", "use --device cpu");
    return {static_cast<unsigned>(across), static_cast<unsigned>(along), static_cast<unsigned>(across * along * n.z)};
}

template <class F>
__global__ void __launch_bounds__(strip_x* strip_y)
    voxels_kernel(Strips blocks, Index3 n, __grid_constant__ F const f, unsigned long long* totals) {
    std::int64_t const x0 = static_cast<std::int64_t>(blockIdx.x % blocks.across) * (strip_x * strips) + threadIdx.x,
                       y = static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * strip_y + threadIdx.y,
                       z = blockIdx.x / blocks.across / blocks.along;
    LossCounts counts;
    if (y < n.y)
        for (std::int64_t x = x0; x < n.x && x < x0 + strip_x * strips; x += strip_x) f(x, y, z, counts);
    if (totals != nullptr) add_counts(counts, totals);
}

/// Calls f(x, y, z, counts) for 0 <= x < n.x, … on the device; `totals` may be null where nothing is counted.
template <class F> void for_each_voxel(Index3 n, F const& f, unsigned long long* totals, char const* name) {
    if (n.x <= 0 || n.y <= 0 || n.z <= 0) return;
    Strips const blocks = strips_of(n);
    voxels_kernel<F><<<blocks.blocks, dim3(strip_x, strip_y)>>>(blocks, n, f, totals);
    check_launch(name);
}

/// The same for functions that look at voxels elsewhere, along slanted rows: warps of 8 by 4 voxels meet fewer lines of
/// the cache there than rows of 32 do.
inline constexpr int slanted_x = 8, slanted_y = 4, slanted_z = 8, slanted_strips = 8;

template <class F>
__global__ void __launch_bounds__(slanted_x* slanted_y* slanted_z)
    slanted_kernel(Strips blocks, Index3 n, __grid_constant__ F const f, unsigned long long* totals) {
    constexpr int width = slanted_x * slanted_strips;
    std::int64_t const x0 = static_cast<std::int64_t>(blockIdx.x % blocks.across) * width + threadIdx.x,
                       y = static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * slanted_y +
                           threadIdx.y,
                       z = static_cast<std::int64_t>(blockIdx.x / blocks.across / blocks.along) * slanted_z +
                           threadIdx.z;
    LossCounts counts;
    if (y < n.y && z < n.z)
        for (std::int64_t x = x0; x < n.x && x < x0 + width; x += slanted_x) f(x, y, z, counts);
    if (totals != nullptr) add_counts(counts, totals);
}

template <class F> void for_each_slanted_voxel(Index3 n, F const& f, unsigned long long* totals, char const* name) {
    if (n.x <= 0 || n.y <= 0 || n.z <= 0) return;
    std::int64_t const width = slanted_x * slanted_strips, across = (n.x + width - 1) / width,
                       along = (n.y + slanted_y - 1) / slanted_y, deep = (n.z + slanted_z - 1) / slanted_z;
    if (across > 0x7fffffff || along > 0x7fffffff / across || deep > 0x7fffffff / (across * along))
        throw Error(ErrorKind::resources, "the volume is too large for one GPU launch", "use --device cpu");
    Strips const blocks{static_cast<unsigned>(across), static_cast<unsigned>(along),
                        static_cast<unsigned>(across * along * deep)};
    slanted_kernel<F><<<blocks.blocks, dim3(slanted_x, slanted_y, slanted_z)>>>(blocks, n, f, totals);
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
