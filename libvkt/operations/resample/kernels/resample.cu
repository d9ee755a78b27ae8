// Resampling kernels: one thread per voxel, the same sums in the same order as on the CPU.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/resample.h"
#include "libvkt/operations/resample/kernels/resample_sums.h"

#include "libvkt/core/wide.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class U>
void nearest(View<U const> in, View<U> out, Box const& box, WeightedSum const& sum, Execution const& execution) {
    std::int64_t const *const x_of = sum.x.first, *const y_of = sum.y.first, *const z_of = sum.z.first;
    gather(execution, box, out,
           [=] VKT_DEVICE(std::int64_t x, std::int64_t y, std::int64_t z) { return in(x_of[x], y_of[y], z_of[z]); });
}

template <class T>
void halved(View<T const> in, View<T> out, Box const& box, Index3 factors, Execution const& execution) {
    int const fx = static_cast<int>(factors.x), fy = static_cast<int>(factors.y), fz = static_cast<int>(factors.z);
    int const shift = log2_of(factors);
    Sum<T> const share = share_of<T>(shift);
    gather(execution, box, out, [=] VKT_DEVICE(std::int64_t x, std::int64_t y, std::int64_t z) {
        Sum<T> pair[2] = {};
        for (int i = 0; i < fx; ++i)
            for (int k = 0; k < fz; ++k)
                for (int j = 0; j < fy; ++j) pair[i] += term_of<T>(in(x * fx + i, y * fy + j, z * fz + k), share);
        return mean_of<T>(pair[0] + pair[1], shift);
    });
}

template <class T> struct WholeAt {
    View<T const> in;
    WeightedSum sum;
    VKT_HD T operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        Int128 total = 0;
        std::int64_t const fx = sum.x.first[x], fy = sum.y.first[y], fz = sum.z.first[z];
        std::int64_t const x0 = sum.x.start[x], y0 = sum.y.start[y], z0 = sum.z.start[z];
        std::int64_t const nx = sum.x.start[x + 1] - x0, ny = sum.y.start[y + 1] - y0, nz = sum.z.start[z + 1] - z0;
        std::int64_t inside = 0;
        for (std::int64_t i = 0; i < nx; ++i)
            for (std::int64_t k = 0; k < nz; ++k)
                for (std::int64_t j = 0; j < ny; ++j) {
                    std::int64_t const weight = as_whole(sum.x.weight[x0 + i]) * as_whole(sum.y.weight[y0 + j]) *
                                                as_whole(sum.z.weight[z0 + k]);
                    inside += weight;
                    total += Int128{weight} * in(fx + i, fy + j, fz + k);
                }
        std::int64_t const divisor = as_whole(sum.x.divisor) * as_whole(sum.y.divisor) * as_whole(sum.z.divisor);
        if (inside != divisor) total += Int128{divisor - inside} * round_to<T>(sum.border);
        return rounded_quotient<T>(total, divisor);
    }
};

template <class T> void whole(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    gather(execution, out.box, out.as<T>(), WholeAt<T>{in.as<T>(), sum});
}

} // namespace

void resample_nearest(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    for_each_size(size_of(in.type), [&]<class U>(U) { nearest<U>(in.as<U>(), out.as<U>(), out.box, sum, execution); });
}

void resample_halved(ConstView in, AnyView out, Index3 factors, Execution const& execution) {
    with_type(in.type, [&]<class T>(T) { halved<T>(in.as<T>(), out.as<T>(), out.box, factors, execution); });
}

void resample_whole(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    if (in.type == DataType::int64) return whole<std::int64_t>(in, out, sum, execution);
    whole<std::uint64_t>(in, out, sum, execution);
}

} // namespace VKT_BACKEND

} // namespace vkt
