// Affine sampling on GPUs: a thread a column of voxels, with the arithmetic of the CPU's rows.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/affine.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/resample/kernels/affine_linear.h"
#include "libvkt/operations/resample/kernels/affine_paths.h"
#include "libvkt/operations/resample/kernels/affine_sample.h"
#include "libvkt/operations/resample/kernels/affine_slices.h"

#include <algorithm>
#include <cstring>

namespace vkt {

namespace VKT_BACKEND {
namespace {

using namespace affine;

/// True if a thread may count in 32 bits wherever the output's positions are and the input's voxels lie.
bool counts_in_32_bits(AffineSampling const& rule, ConstView const& in, Box const& out) {
    auto const size = static_cast<std::int64_t>(size_of(in.type));
    bool small = std::max({rule.dims.x, rule.dims.y, rule.dims.z}) < most_counted && in.row * size < most_counted &&
                 in.slice * size < most_counted;
    for (int corner = 0; corner < 8; ++corner) {
        PositionRow const row = row_of(rule.map, {}, corner % 2 != 0 ? out.upper.y - 1 : out.lower.y,
                                       corner / 2 % 2 != 0 ? out.upper.z - 1 : out.lower.z);
        auto const x = static_cast<double>(corner / 4 != 0 ? out.upper.x - 1 : out.lower.x);
        for (int axis = 0; axis < 3; ++axis)
            small = small && std::abs(row.line(axis).base + x * row.line(axis).step) < most_counted;
    }
    return small;
}

template <class Kernel, class C, class T>
void launch_sample(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    Sample<Kernel, C, T> const sample{device_sampling(rule, in, out.box),
                                      {driver::device_rows(in, in.box)},
                                      driver::device_rows(ConstView(out), out.box)};
    driver::for_each_voxel<driver::SlantedBlock>(out.dims(), sample, totals, "affine_sample");
}

/// Losses, and the voxels outside.
void count(driver::DeviceLosses const& counts, Losses& losses, std::int64_t& outside) {
    Losses found;
    counts.add_to(found);
    outside += found.undefined;
    found.undefined = 0;
    losses += found;
}

template <class U> struct NearestVoxel {
    DeviceSampling s;
    driver::DeviceRows in, out;
    U background;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        auto const column = static_cast<double>(s.first.x + x);
        PositionRow const at = row_of(s.map, {}, s.first.y + y, s.first.z + z);
        double const px = at.x(column), py = at.y(column), pz = at.z(column);
        U value = background;
        if (!s.bounded && !(lies_in(px, s.end_x) && lies_in(py, s.end_y) && lies_in(pz, s.end_z))) {
            ++counts.undefined;
        } else {
            double const half = 0.5 + face_slack;
            std::int64_t const vx = index_at(s, std::floor(px + half), 0, s.dims.x, s.lower.x),
                               vy = index_at(s, std::floor(py + half), 0, s.dims.y, s.lower.y),
                               vz = index_at(s, std::floor(pz + half), 0, s.dims.z, s.lower.z);
            bool const border = s.boundary == Boundary::border && (vx < 0 || vy < 0 || vz < 0);
            if (!border) value = *reinterpret_cast<U const*>(in.at(vx - s.lower.x, vy - s.lower.y, vz - s.lower.z));
        }
        *reinterpret_cast<U*>(out.at(x, y, z)) = value;
    }
};

template <class U>
void launch_nearest(ConstView in, AnyView out, AffineSampling const& rule, VoxelBytes const& voxel,
                    unsigned long long* totals) {
    NearestVoxel<U> nearest{device_sampling(rule, in, out.box), driver::device_rows(in, in.box),
                            driver::device_rows(ConstView(out), out.box), U{}};
    std::memcpy(&nearest.background, voxel.data(), sizeof nearest.background);
    driver::for_each_voxel<driver::SlantedBlock>(out.dims(), nearest, totals, "affine_nearest");
}

/// Linear in float32, of the types that it holds.
template <class T>
void launch_single(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (!counts_in_32_bits(rule, in, out.box)) return launch_sample<Linear, float, T>(in, out, rule, totals);
    DeviceSampling const s = device_sampling(rule, in, out.box);
    driver::DeviceRows const rows = driver::device_rows(in, in.box);
    auto const before = s.lower.z * rows.slice + s.lower.y * rows.row + s.lower.x * rows.size;
    auto const inner = [](int n) { return static_cast<unsigned>(n - 1); };
    LinearSample<T> const sample{{s, {rows}, driver::device_rows(ConstView(out), out.box)},
                                 rows.data - before,
                                 static_cast<int>(rows.row),
                                 static_cast<int>(rows.slice),
                                 inner(s.inner_x),
                                 inner(s.inner_y),
                                 inner(s.inner_z),
                                 in.type == out.type};
    if (StillAxis const still = still_axis(rule.map); has_slices(still, sample))
        return launch_slices(out.dims(), still, sample, totals);
    if (sample.typed_out) return launch_paths(out.dims(), sample, totals);
    launch_linear(out.dims(), sample, totals);
}

void sample_single(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (in.type == DataType::float32) return launch_single<float>(in, out, rule, totals);
    if (in.type == DataType::uint8) return launch_single<std::uint8_t>(in, out, rule, totals);
    if (in.type == DataType::uint16) return launch_single<std::uint16_t>(in, out, rule, totals);
    if (in.type == DataType::int16) return launch_single<std::int16_t>(in, out, rule, totals);
    launch_sample<Linear, float, void>(in, out, rule, totals);
}

/// The coefficients of splines are floats; of other types the voxels' is looked up.
template <class Kernel>
void sample_floats(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (in.type == DataType::float32) return launch_sample<Kernel, double, float>(in, out, rule, totals);
    launch_sample<Kernel, double, void>(in, out, rule, totals);
}

/// Of voxels of the usual types that is a third of the time of looking it up.
template <class Kernel>
void sample_voxels(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (in.type == DataType::uint8) return launch_sample<Kernel, double, std::uint8_t>(in, out, rule, totals);
    if (in.type == DataType::uint16) return launch_sample<Kernel, double, std::uint16_t>(in, out, rule, totals);
    if (in.type == DataType::int16) return launch_sample<Kernel, double, std::int16_t>(in, out, rule, totals);
    sample_floats<Kernel>(in, out, rule, totals);
}

} // namespace

void affine_sample(ConstView in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                   Execution const&) {
    if (out.box.empty()) return;
    driver::DeviceLosses const counts;
    if (rule.single) {
        sample_single(in, out, rule, counts.get());
    } else {
        switch (rule.interpolant) {
        case Interpolant::nearest:
            launch_sample<Nearest, double, void>(in, out, rule, counts.get());
            break;
        case Interpolant::linear:
            launch_sample<Linear, double, void>(in, out, rule, counts.get());
            break;
        case Interpolant::cubic:
            sample_voxels<Cubic>(in, out, rule, counts.get());
            break;
        case Interpolant::lanczos3:
            sample_voxels<Lanczos3>(in, out, rule, counts.get());
            break;
        case Interpolant::bspline3:
            sample_floats<BSpline3>(in, out, rule, counts.get());
            break;
        case Interpolant::bspline5:
            sample_floats<BSpline5>(in, out, rule, counts.get());
        }
    }
    count(counts, losses, outside);
}

void affine_nearest(ConstView in, AnyView out, AffineSampling const& rule, std::int64_t& outside, Execution const&) {
    if (out.box.empty()) return;
    VoxelBytes const voxel = voxel_bytes(out.type, rule.boundary ? rule.border : rule.background);
    driver::DeviceLosses const counts;
    switch (size_of(in.type)) {
    case 1:
        launch_nearest<std::uint8_t>(in, out, rule, voxel, counts.get());
        break;
    case 2:
        launch_nearest<std::uint16_t>(in, out, rule, voxel, counts.get());
        break;
    case 4:
        launch_nearest<std::uint32_t>(in, out, rule, voxel, counts.get());
        break;
    default:
        launch_nearest<std::uint64_t>(in, out, rule, voxel, counts.get());
    }
    Losses none;
    count(counts, none, outside);
}

} // namespace VKT_BACKEND
} // namespace vkt
