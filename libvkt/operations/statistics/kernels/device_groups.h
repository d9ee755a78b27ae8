// Which groups voxels belong to, on a GPU.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/operations/statistics/kernels/grouped_slab.h"

namespace vkt::VKT_BACKEND {
namespace {

/// Which voxels count, and the groups that they belong to; by their places in the slab.
struct Groups {
    GroupedBy by;
    Index3 lower;
    driver::DeviceRows mask, labels; ///< without data: there are none
    double zero;

    explicit Groups(GroupedSlab const& slab)
        : by(slab.by), lower(slab.voxels.box.lower), mask(beside(slab.mask, slab)), labels(beside(slab.labels, slab)),
          zero(slab.zero) {}

    __device__ bool counts(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return mask.data == nullptr || driver::load_value<double>(mask.type, mask.at(x, y, z)) != zero;
    }
    __device__ std::int64_t key(std::int64_t x, std::int64_t y, std::int64_t z) const {
        switch (by) {
        case GroupedBy::volume:
            return 0;
        case GroupedBy::x:
            return lower.x + x;
        case GroupedBy::y:
            return lower.y + y;
        case GroupedBy::z:
            return lower.z + z;
        case GroupedBy::label:
            break;
        }
        std::int64_t key = 0;
        with_type(labels.type, [&]<class L>(L) {
            if constexpr (std::is_integral_v<L>)
                key = static_cast<std::int64_t>(*reinterpret_cast<L const*>(labels.at(x, y, z)));
        });
        return key;
    }

private:
    static driver::DeviceRows beside(std::optional<ConstView> const& view, GroupedSlab const& slab) {
        return view ? driver::device_rows(*view, slab.voxels.box) : driver::DeviceRows{};
    }
};

} // namespace
} // namespace vkt::VKT_BACKEND
