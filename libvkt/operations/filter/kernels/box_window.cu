// Sums and extremes of boxes and balls on GPUs: windows along one axis after the other; balls from all their voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/box_window.h"

#include "libvkt/kernel/cuda_stencil.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/order.h"
#include "libvkt/operations/filter/kernels/device_large_values.h"
#include "libvkt/operations/filter/kernels/window_parts.h"

#include <cstring>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

/// A voxel as what is summed up, or as its key.
template <class Op, class S> __device__ __forceinline__ S load(DataType type, std::byte const* from) {
    if constexpr (std::is_same_v<Op, Sum>)
        return static_cast<S>(driver::load_value<double>(type, from));
    else
        return driver::load_neighbour<S>(type, from);
}

/// out(p) = in(p) op … op in(p + w - 1) along an axis; both of the same coordinates, from their first voxels on.
template <class Op, class S> struct AlongAxis {
    S const* in;
    S* out;
    std::int64_t in_row, in_slice, row, slice, step;
    std::int64_t width;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        S const* from = in + x + y * in_row + z * in_slice;
        S value = *from;
        for (std::int64_t i = 1; i < width; ++i) value = Op::of(value, from[i * step]);
        out[x + y * row + z * slice] = value;
    }
};

/// The first pass, along x, from voxels of any type.
template <class Op, class S> struct AlongRow {
    driver::DeviceRows in;
    S* out;
    std::int64_t row, slice;
    std::int64_t width;
    S scale; ///< of what is summed up

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        S value = load<Op, S>(in.type, in.at(x, y, z));
        if constexpr (std::is_same_v<Op, Sum>) value *= scale;
        for (std::int64_t i = 1; i < width; ++i) {
            S next = load<Op, S>(in.type, in.at(x + i, y, z));
            if constexpr (std::is_same_v<Op, Sum>) next *= scale;
            value = Op::of(value, next);
        }
        out[x + y * row + z * slice] = value;
    }
};

/// Stores what the last pass, along z, makes.
template <class Op, class S> struct AlongColumn {
    S const* in;
    std::int64_t row, slice;
    driver::DeviceRows out;
    std::int64_t width;
    double count; ///< of the voxels of a box
    S scale;      ///< not 1: only means of float64 that are not finite are stored

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        S const* from = in + x + y * row + z * slice;
        S value = *from;
        for (std::int64_t i = 1; i < width; ++i) value = Op::of(value, from[i * slice]);
        std::byte* const to = out.at(x, y, z);
        if constexpr (!std::is_same_v<Op, Sum>) {
            driver::store_result(out.type, to, value, counts);
        } else if (scale == S(1)) {
            double const mean = static_cast<double>(value) / count;
            if (out.type == DataType::float64 && !is_finite(mean)) ++counts.undefined;
            driver::store_value(out.type, to, mean, counts);
        } else if (double& mean = *reinterpret_cast<double*>(to); !is_finite(mean)) {
            mean = mean_of_scaled(static_cast<double>(value), count, static_cast<double>(scale));
        }
    }
};

template <class Op, class S> void windows(ConstView in, AnyView out, Index3 radius, Losses& losses, S scale = 1) {
    if (out.box.empty()) return;
    Index3 const n = out.dims(), w{2 * radius.x + 1, 2 * radius.y + 1, 2 * radius.z + 1};
    Index3 const first{n.x, n.y + 2 * radius.y, n.z + 2 * radius.z}, second{n.x, n.y, first.z};
    auto const bytes = [](Index3 dims) { return static_cast<std::size_t>(dims.x * dims.y * dims.z) * sizeof(S); };
    driver::DeviceScratch const rows(bytes(first)), planes(bytes(second));
    auto* const along_x = reinterpret_cast<S*>(rows.get());
    auto* const along_y = reinterpret_cast<S*>(planes.get());
    Box const seen{out.box.lower - radius, out.box.upper + radius};
    driver::for_each_voxel(first,
                           AlongRow<Op, S>{driver::device_rows(in, seen), along_x, n.x, n.x * first.y, w.x, scale},
                           nullptr, "box windows along x");
    driver::for_each_voxel(second, AlongAxis<Op, S>{along_x, along_y, n.x, n.x * first.y, n.x, n.x * n.y, n.x, w.y},
                           nullptr, "box windows along y");
    driver::DeviceLosses const counts;
    driver::for_each_voxel(n,
                           AlongColumn<Op, S>{along_y, n.x, n.x * n.y, driver::device_rows(ConstView(out), out.box),
                                              w.z, static_cast<double>(w.x * w.y * w.z), scale},
                           counts.get(), "box windows along z");
    counts.add_to(losses);
}

/// Sums of float64 that overflow are made again of smaller voxels.
void means_in_double(ConstView in, AnyView out, Index3 radius, Losses& losses) {
    Losses mine;
    windows<Sum, double>(in, out, radius, mine);
    if (in.type == DataType::float64) {
        Index3 const w{2 * radius.x + 1, 2 * radius.y + 1, 2 * radius.z + 1};
        double const scale = scale_of_boxes(static_cast<double>(w.x * w.y * w.z));
        if (mine.undefined > 0 && any_large_on_device(in, {out.box.lower - radius, out.box.upper + radius}, scale))
            windows<Sum, double>(in, out, radius, mine, scale);
        mine.undefined = 0;
    }
    losses += mine;
}

/// Half of the row of a ball at (dy, dz), -1 where there is none.
template <class Op, class K> struct Ball {
    driver::DeviceRows in, out; ///< in at the first of the window
    int const* half;
    int rx, ry, rz;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        K value = load<Op, K>(in.type, in.at(x + rx, y + ry, z + rz));
        for (int k = 0; k <= 2 * rz; ++k)
            for (int j = 0; j <= 2 * ry; ++j) {
                int const h = half[k * (2 * ry + 1) + j];
                for (int i = rx - h; i <= rx + h; ++i)
                    value = Op::of(value, load<Op, K>(in.type, in.at(x + i, y + j, z + k)));
            }
        driver::store_result(out.type, out.at(x, y, z), value, counts);
    }
};

template <class Op, class K> void balls(ConstView in, AnyView out, Index3 radius) {
    std::vector<int> const halves = halves_of(radius);
    driver::DeviceList const table(halves);
    Box const seen{out.box.lower - radius, out.box.upper + radius};
    driver::for_each_voxel(out.dims(),
                           Ball<Op, K>{driver::device_rows(in, seen), driver::device_rows(ConstView(out), out.box),
                                       table.get(), static_cast<int>(radius.x), static_cast<int>(radius.y),
                                       static_cast<int>(radius.z)},
                           nullptr, "balls");
}

} // namespace

void mean_of_boxes(ConstView in, AnyView out, Index3 radius, Continuation const&, Losses& losses, Execution const&) {
    if (box_sum_bytes(in.type, radius) == 4)
        windows<Sum, std::int32_t>(in, out, radius, losses);
    else
        means_in_double(in, out, radius, losses);
}

void extreme_of_boxes(ConstView in, AnyView out, Index3 radius, Continuation const&, WindowExtreme extreme,
                      Execution const&) {
    Losses none;
    with_extreme(extreme, in.type, [&]<class Op, class K>(Op, K) { windows<Op, K>(in, out, radius, none); });
}

void extreme_of_balls(ConstView in, AnyView out, Index3 radius, WindowExtreme extreme, Execution const&) {
    if (out.box.empty()) return;
    with_extreme(extreme, in.type, [&]<class Op, class K>(Op, K) { balls<Op, K>(in, out, radius); });
}

void difference_of(ConstView a, ConstView b, AnyView out, Losses& losses, Execution const& execution) {
    if (is_integer(a.type) && size_of(a.type) == 8)
        return map<Int128>(execution, out, losses, Subtract<Int128>{}, a, b);
    with_compute_type(a.type, [&]<class C>(C) { map<C>(execution, out, losses, Subtract<C>{}, a, b); });
}

} // namespace vkt::VKT_BACKEND
