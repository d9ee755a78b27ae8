// A pass of the selection in groups on GPUs: a thread a voxel, counters in global memory.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/grouped_counts.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/device_groups.h"
#include "libvkt/operations/statistics/ordered_bits.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class T> struct CountVoxel {
    Groups groups;
    View<T const> in;
    std::int64_t const* keys;
    std::int64_t count;
    bool contiguous;
    QuantileClasses classes;
    unsigned long long *counters, *kept, *arrived;

    __device__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z, driver::LossCounts&) const {
        if (!groups.counts(x, y, z)) return;
        T const voxel = in.data[x + y * in.row + z * in.slice];
        if (!is_finite_voxel(voxel)) return;
        std::int64_t const group = group_of(groups.key(x, y, z));
        if (group < 0) return;
        auto const bits = static_cast<std::uint64_t>(ordered_bits(voxel));
        std::uint32_t const k = classes.of(static_cast<std::uint32_t>(group), bits);
        if (k == QuantileClasses::none) return;
        QuantileClass const& c = classes.classes[k];
        if (!c.keeps) {
            atomicAdd(counters + c.at + classes.next(bits), 1ull);
            return;
        }
        // They are sorted in the end.
        auto const place = static_cast<std::int64_t>(atomicAdd(arrived + k, 1ull));
        if (place < c.voxels) kept[c.at + place] = bits;
    }

private:
    __device__ std::int64_t group_of(std::int64_t key) const {
        if (count == 0 || key < keys[0] || key > keys[count - 1]) return -1;
        if (contiguous) return key - keys[0];
        std::int64_t low = 0, high = count; // the last key that is not beyond
        while (high - low > 1) {
            std::int64_t const middle = (low + high) / 2;
            (keys[middle] <= key ? low : high) = middle;
        }
        return keys[low] == key ? low : -1;
    }
};

template <class To> To* updated(Buffer& buffer) { return reinterpret_cast<To*>(buffer.update(Space::device)); }
template <class To> To const* present(Buffer& buffer) {
    return reinterpret_cast<To const*>(buffer.read(Space::device));
}

template <class T> void count(GroupedSlab const& slab, DeviceQuantiles& pass) {
    CountVoxel<T> const each{
        Groups(slab),
        slab.voxels.as<T>(),
        present<std::int64_t>(pass.keys),
        pass.groups,
        pass.contiguous,
        {present<QuantileClass>(pass.classes), present<std::uint32_t>(pass.first), pass.width, pass.known, pass.step},
        updated<unsigned long long>(pass.counters),
        updated<unsigned long long>(pass.kept),
        updated<unsigned long long>(pass.arrived)};
    driver::for_each_voxel(slab.voxels.dims(), each, nullptr, "percentiles of groups");
}

} // namespace

void grouped_counts(GroupedSlab const& slab, DeviceQuantiles& pass, Execution const&) {
    with_type(slab.voxels.type, [&]<class T>(T) { count<T>(slab, pass); });
}

} // namespace VKT_BACKEND

} // namespace vkt
