// Counting by ordered patterns on CPUs: every thread for itself.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/ordered_counts.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/ordered_bits.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class T>
void count_row(T const* row, std::int64_t n, OrderedClasses const& classes, std::uint64_t* counters) {
    int const left = classes.left(), next = classes.next();
    std::size_t const each = classes.counters();
    if (classes.known == 0) { // all belong to the one class there is
        for (std::int64_t i = 0; i < n; ++i)
            if (is_finite_voxel(row[i])) ++counters[ordered_bits(row[i]) >> left];
        return;
    }
    for (std::int64_t i = 0; i < n; ++i) {
        if (!is_finite_voxel(row[i])) continue;
        std::uint64_t const key = static_cast<std::uint64_t>(ordered_bits(row[i])) >> left, prefix = key >> next;
        for (int c = 0; c < classes.count; ++c)
            if (classes.prefixes[c] == prefix)
                ++counters[static_cast<std::size_t>(c) * each + (key & ((std::uint64_t{1} << next) - 1))];
    }
}

} // namespace

void count_ordered(ConstView in, OrderedClasses const& classes, std::uint64_t* const* sets, int threads,
                   Execution const&) {
    Index3 const n = in.box.dims();
    constexpr std::int64_t piece = 65536;
    std::int64_t const pieces = (n.x + piece - 1) / piece;
    with_type(in.type, [&]<class T>(T) {
        View<T const> const voxels = in.as<T>();
        Box const box = in.box;
#pragma omp parallel for num_threads(threads) schedule(static) if (threads > 1)
        for (std::int64_t i = 0; i < pieces * n.y * n.z; ++i) {
            std::int64_t const x = i % pieces * piece, y = i / pieces % n.y, z = i / pieces / n.y;
            count_row(&voxels(box.lower.x + x, box.lower.y + y, box.lower.z + z), n.x - x < piece ? n.x - x : piece,
                      classes, sets[threads > 1 ? omp_get_thread_num() : 0]);
        }
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
