// Work on a GPU that is a function of a voxel's place: a thread a column of a few voxels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_map.h"

#include <type_traits>
#include <vector>

namespace vkt::VKT_BACKEND {

namespace driver {

/// Voxels of a block of threads: rows of a warp, and columns of voxels that a thread goes through one after the other.
inline constexpr int column_x = 32, column_y = 8, column_z = 4;

struct Columns {
    unsigned across, along, blocks;
};

inline Columns columns_of(Index3 n) {
    std::int64_t const across = (n.x + column_x - 1) / column_x, along = (n.y + column_y - 1) / column_y,
                       deep = (n.z + column_z - 1) / column_z;
    if (across > 0x7fffffff || along > 0x7fffffff / across || deep > 0x7fffffff / (across * along))
        throw Error(ErrorKind::resources, "the volume is too large for one GPU launch", "use --device cpu");
    return {static_cast<unsigned>(across), static_cast<unsigned>(along), static_cast<unsigned>(across * along * deep)};
}

template <class F>
__global__ void __launch_bounds__(column_x* column_y)
    voxels_kernel(Columns columns, Index3 n, __grid_constant__ F const f, unsigned long long* totals) {
    std::int64_t const x = static_cast<std::int64_t>(blockIdx.x % columns.across) * column_x + threadIdx.x,
                       y = static_cast<std::int64_t>(blockIdx.x / columns.across % columns.along) * column_y +
                           threadIdx.y,
                       z = static_cast<std::int64_t>(blockIdx.x / columns.across / columns.along) * column_z;
    LossCounts counts;
    if (x < n.x && y < n.y)
        for (std::int64_t k = z; k < z + column_z && k < n.z; ++k) f(x, y, k, counts);
    if (totals != nullptr) add_counts(counts, totals);
}

/// Calls f(x, y, z, counts) for 0 <= x < n.x, … on the device; `totals` may be null where nothing is counted.
template <class F> void for_each_voxel(Index3 n, F const& f, unsigned long long* totals, char const* name) {
    if (n.x <= 0 || n.y <= 0 || n.z <= 0) return;
    Columns const columns = columns_of(n);
    voxels_kernel<F><<<columns.blocks, dim3(column_x, column_y)>>>(columns, n, f, totals);
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
