// What the resampling kernels are told.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/resample/resample_weights.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vkt {

/// Everything that the weighted kernels need besides the voxels.
struct WeightedSum {
    AxisTable x, y, z;
    double divisor = 1;           ///< product of the axes' divisors
    double unit = 1;              ///< power of two that all weights are multiplied with, lest float64 overflows
    double scale = 1, offset = 0; ///< applied before the value is stored
    double border = 0;            ///< stored value outside, where a table says how much of the weights is inside
    bool x_identity = false;
    bool in_passes = false; ///< along z, then y, then x, instead of all rows of a footprint at once
    SumTile tile;           ///< CPU: this much at a time

    VKT_HD bool reaches_border() const { return x.inside != nullptr || y.inside != nullptr || z.inside != nullptr; }
};

/// Output voxels of a row that are summed together in whole numbers: for their columns there is room in the first
/// cache.
inline std::int64_t summed_together(std::int64_t n_in, std::int64_t n_out) {
    constexpr std::int64_t columns = 2048;
    return std::clamp<std::int64_t>(columns * n_out / std::max<std::int64_t>(n_in, 1), 32, columns);
}
/// CPU: bytes that each thread holds for the sums of columns, of `size` bytes each, and the row that becomes of them.
inline std::int64_t bytes_of_sums(std::int64_t n_in, std::int64_t n_out, std::int64_t taps, std::int64_t size) {
    std::int64_t const together = summed_together(n_in, n_out);
    return size * (together + std::min(n_in, together * n_in / std::max<std::int64_t>(n_out, 1) + taps) + 1);
}

/// The sum along three axes of voxels of a type, whose values stay as they are and outside of which lies 0.
inline WeightedSum weighted_sum(std::array<WeightTable, 3> const& tables, DataType type, Space space) {
    WeightedSum sum;
    sum.x = tables[0].taps(space);
    sum.y = tables[1].taps(space);
    sum.z = tables[2].taps(space);
    sum.divisor = tables[0].divisor() * tables[1].divisor() * tables[2].divisor();
    // Sums of float64 then stay below a quarter of the largest number, those of kernels that overshoot as well.
    double const gain = tables[0].gain() * tables[1].gain() * tables[2].gain();
    if (type == DataType::float64) sum.unit = std::exp2(-std::ceil(std::log2(sum.divisor * gain)) - 2);
    sum.x_identity = tables[0].kernel() == ResampleKernel::identity;
    sum.in_passes = in_passes(tables);
    sum.tile = SumTile(tables);
    return sum;
}

VKT_KERNEL(resample_nearest, (ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution),
           (in, out, sum, execution))
VKT_KERNEL(resample_halved, (ConstView in, AnyView out, Index3 factors, Execution const& execution),
           (in, out, factors, execution))
VKT_KERNEL(resample_whole, (ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution),
           (in, out, sum, execution))
VKT_KERNEL(resample_weighted,
           (ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Losses& losses,
            Execution const& execution),
           (in, out, sum, scratch, losses, execution))

} // namespace vkt
