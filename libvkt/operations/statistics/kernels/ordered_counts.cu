// Counting by ordered patterns on GPUs: a pass over the voxels for each class.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/ordered_counts.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/device_counts.h"
#include "libvkt/operations/statistics/ordered_bits.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct OrderedSlot {
    template <class T> using is_cheap = std::true_type;
    std::uint64_t prefix;
    int next, left;

    template <class T> VKT_DEVICE int operator()(T voxel) const {
        int const others = 1 << next;
        if (!is_finite_voxel(voxel)) return others;
        std::uint64_t const key = static_cast<std::uint64_t>(ordered_bits(voxel)) >> left;
        return key >> next == prefix ? static_cast<int>(key & static_cast<unsigned>(others - 1)) : others;
    }
};

} // namespace

void count_ordered(ConstView in, OrderedClasses const& classes, std::uint64_t* const* sets, int, Execution const&) {
    std::size_t const counters = classes.counters();
    with_type(in.type, [&]<class T>(T) {
        for (int c = 0; c < classes.count; ++c)
            driver::count_on_device<T>(
                in, {in.box, {1, 1, 1}}, OrderedSlot{classes.prefixes[c], classes.next(), classes.left()}, counters,
                reinterpret_cast<unsigned long long*>(sets[0]) + static_cast<std::size_t>(c) * counters);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
