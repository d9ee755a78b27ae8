// Weighted sums on GPUs: one thread a voxel, or one in each of three passes; the same sums in the same order as on the
// CPU.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/resample.h"
#include "libvkt/operations/resample/kernels/resample_sums.h"

#include "libvkt/kernel/kernel.h"

#include <algorithm>

namespace vkt::VKT_BACKEND {
namespace {

template <class T> struct WeightedAt {
    View<T const> in;
    WeightedSum sum;
    VKT_HD double operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        double total = 0;
        std::int64_t const fx = sum.x.first[x], fy = sum.y.first[y], fz = sum.z.first[z];
        std::int64_t const x0 = sum.x.start[x], y0 = sum.y.start[y], z0 = sum.z.start[z];
        std::int64_t const nx = sum.x.start[x + 1] - x0, ny = sum.y.start[y + 1] - y0, nz = sum.z.start[z + 1] - z0;
        for (std::int64_t i = 0; i < nx; ++i) {
            double column = 0;
            for (std::int64_t k = 0; k < nz; ++k)
                for (std::int64_t j = 0; j < ny; ++j)
                    column += sum.z.weight[z0 + k] * sum.y.weight[y0 + j] * sum.unit *
                              static_cast<double>(in(fx + i, fy + j, fz + k));
            total += sum.x_identity ? column : sum.x.weight[x0 + i] * column;
        }
        if (sum.reaches_border()) {
            double const rest = sum.divisor - inside_of(sum.x, x) * (inside_of(sum.y, y) * inside_of(sum.z, z));
            if (rest != 0) total += rest * sum.unit * sum.border;
        }
        return divided<T>(total, sum.divisor * sum.unit) * sum.scale + sum.offset;
    }
};

template <class T>
void weighted_to_double(View<T const> in, View<double> out, Box const& box, WeightedSum const& sum,
                        Execution const& execution) {
    gather(execution, box, out, WeightedAt<T>{in, sum});
}
template <class T>
void weighted_same_type(View<T const> in, View<T> out, Box const& box, WeightedSum const& sum, Losses& losses,
                        Execution const& execution) {
    gather_rounded(execution, box, out, losses, WeightedAt<T>{in, sum});
}
template <class U>
void store_doubles(View<double const> in, View<U> out, Box const& box, Losses& losses, Execution const& execution) {
    map_rounded(
        execution, box, out, losses, [=] VKT_DEVICE(double v) { return v; }, in);
}

template <class T>
void at_once(ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Losses& losses,
             Execution const& execution) {
    if (in.type == out.type) return weighted_same_type(in.as<T>(), out.as<T>(), out.box, sum, losses, execution);
    scratch.reserve(static_cast<std::size_t>(out.box.voxels()) * sizeof(double));
    AnyView const wide = dense_view(scratch.write(Space::device), DataType::float64, out.box, Space::device);
    weighted_to_double<T>(in.as<T>(), wide.as<double>(), out.box, sum, execution);
    with_type(out.type, [&]<class U>(U) {
        store_doubles<U>(ConstView(wide).as<double>(), out.as<U>(), out.box, losses, execution);
    });
}

template <class T> struct AlongZ {
    View<T const> in;
    AxisTable z;
    double unit;
    VKT_HD double operator()(std::int64_t x, std::int64_t y, std::int64_t o) const {
        double total = 0;
        for (std::int64_t k = z.start[o], at = z.first[o]; k < z.start[o + 1]; ++k, ++at)
            total += z.weight[k] * unit * static_cast<double>(in(x, y, at));
        return total;
    }
};

struct AlongY {
    View<double const> in;
    AxisTable y;
    VKT_HD double operator()(std::int64_t x, std::int64_t o, std::int64_t z) const {
        double total = 0;
        for (std::int64_t k = y.start[o], at = y.first[o]; k < y.start[o + 1]; ++k, ++at)
            total += y.weight[k] * in(x, at, z);
        return total;
    }
};

/// T: of the volume's voxels.
template <class T> struct AlongX {
    View<double const> in;
    WeightedSum sum;
    VKT_HD double operator()(std::int64_t o, std::int64_t y, std::int64_t z) const {
        double total = 0;
        for (std::int64_t k = sum.x.start[o], at = sum.x.first[o]; k < sum.x.start[o + 1]; ++k, ++at)
            total += sum.x_identity ? in(at, y, z) : sum.x.weight[k] * in(at, y, z);
        if (sum.reaches_border()) {
            double const rest = sum.divisor - inside_of(sum.x, o) * (inside_of(sum.y, y) * inside_of(sum.z, z));
            if (rest != 0) total += rest * sum.unit * sum.border;
        }
        return divided<T>(total, sum.divisor * sum.unit) * sum.scale + sum.offset;
    }
};

void in_passes(ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Losses& losses,
               Execution const& execution) {
    Box const& box = out.box;
    if (box.empty()) return;
    Box after_z = in.box, after_y = in.box;
    after_z.lower.z = after_y.lower.z = box.lower.z;
    after_z.upper.z = after_y.upper.z = box.upper.z;
    after_y.lower.y = box.lower.y;
    after_y.upper.y = box.upper.y;
    std::int64_t const first = std::max(after_z.voxels(), box.voxels());
    scratch.reserve(static_cast<std::size_t>(first + after_y.voxels()) * sizeof(double));
    std::byte* const memory = scratch.write(Space::device);
    auto const doubles = [&](std::int64_t at, Box const& of) {
        return dense_view(memory + at * static_cast<std::int64_t>(sizeof(double)), DataType::float64, of,
                          Space::device);
    };
    AnyView const slices = doubles(0, after_z), rows = doubles(first, after_y), columns = doubles(0, box);
    with_type(in.type, [&]<class T>(T) {
        gather(execution, after_z, slices.as<double>(), AlongZ<T>{in.as<T>(), sum.z, sum.unit});
    });
    gather(execution, after_y, rows.as<double>(), AlongY{ConstView(slices).as<double>(), sum.y});
    View<double const> const from = ConstView(rows).as<double>();
    if (in.type == DataType::float64)
        gather(execution, box, columns.as<double>(), AlongX<double>{from, sum});
    else
        gather(execution, box, columns.as<double>(), AlongX<float>{from, sum});
    with_type(out.type, [&]<class U>(U) {
        store_doubles<U>(ConstView(columns).as<double>(), out.as<U>(), box, losses, execution);
    });
}

} // namespace

void resample_weighted(ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Losses& losses,
                       Execution const& execution) {
    if (sum.in_passes) return in_passes(in, out, sum, scratch, losses, execution);
    with_type(in.type, [&]<class T>(T) { at_once<T>(in, out, sum, scratch, losses, execution); });
}

} // namespace vkt::VKT_BACKEND
