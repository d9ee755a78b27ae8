// Large voxels in device memory. For CUDA sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/large_values.h"

namespace vkt::VKT_BACKEND {
namespace {

/// Counts voxels that are so large that something in between may overflow.
template <class C> struct CountLarge {
    driver::DeviceRows rows;
    C headroom;
    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        C const value = driver::load_value<C>(rows.type, rows.at(x, y, z));
        counts.undefined += is_large(value, headroom) ? 1 : 0;
    }
};

template <class C> bool any_large_on_device(ConstView in, Box const& box, C headroom) {
    driver::DeviceLosses const counts;
    driver::for_each_voxel(box.dims(), CountLarge<C>{driver::device_rows(in, box), headroom}, counts.get(),
                           "large voxels");
    Losses found;
    counts.add_to(found);
    return found.undefined > 0;
}

} // namespace
} // namespace vkt::VKT_BACKEND
