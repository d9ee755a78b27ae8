// What windows of boxes and balls are made of, on CPUs and GPUs: how two values join, and the rows of a ball.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/order.h"
#include "libvkt/operations/filter/kernels/box_window.h"
#include "libvkt/operations/filter/kernels/large_values.h"

#include <cmath>
#include <limits>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

struct Sum {
    template <class S> VKT_HD static S of(S a, S b) { return a + b; }
};
struct Least {
    template <class S> VKT_HD static S of(S a, S b) { return a < b ? a : b; }
};
struct Greatest {
    template <class S> VKT_HD static S of(S a, S b) { return a < b ? b : a; }
};

/// A power of two by which float64 may be multiplied so that no sum of so many overflows.
inline double scale_of_boxes(double count) { return std::exp2(-std::ceil(std::log2(count))); }
/// The mean of voxels from the sum of what they are times `scale`; that of numbers is one.
VKT_HD double mean_of_scaled(double sum, double count, double scale) {
    constexpr double most = std::numeric_limits<double>::max();
    double const mean = sum / count, result = mean / scale;
    if (!is_finite(mean) || is_finite(result)) return result;
    return result > 0 ? most : -most;
}

/// How far the rows of an ellipsoid reach to either side, y fastest; -1 for rows that it has no voxel of. Offsets are
/// exactly on it for whole numbers: compared with room for rounding, far less than the next offset is off.
inline std::vector<int> halves_of(Index3 radius) {
    auto const inside = [](std::int64_t d, std::int64_t r) {
        double const share = r == 0 ? 0 : static_cast<double>(d) / static_cast<double>(r);
        return share * share;
    };
    std::vector<int> halves;
    for (std::int64_t dz = -radius.z; dz <= radius.z; ++dz)
        for (std::int64_t dy = -radius.y; dy <= radius.y; ++dy) {
            double const rest = inside(dy, radius.y) + inside(dz, radius.z);
            int half = rest > 1 + 1e-9 ? -1 : 0;
            while (half >= 0 && half < radius.x && rest + inside(half + 1, radius.x) <= 1 + 1e-9) ++half;
            halves.push_back(half);
        }
    return halves;
}

/// Calls f(Op{}, K{}).
template <class F> inline void with_extreme(WindowExtreme extreme, DataType type, F const& f) {
    with_order_key(type, [&]<class K>(K key) {
        if (extreme == WindowExtreme::least)
            f(Least{}, key);
        else
            f(Greatest{}, key);
    });
}

template <class C> struct Subtract {
    VKT_HD C operator()(C a, C b) const { return a - b; }
};

} // namespace
} // namespace vkt::VKT_BACKEND
