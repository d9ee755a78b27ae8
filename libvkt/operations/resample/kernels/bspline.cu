// Spline coefficients on GPUs: three passes, a thread a coefficient, with the CPU's sums.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/bspline.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

/// A pass along one axis over `box`, of which the voxels inside the volume lie in `in`.
struct Pass {
    Box box;
    int axis = 0;
    std::int64_t dims = 1; ///< of the volume along the axis
    double const* weight = nullptr;
    int radius = 0;
    double centre = 1;
    Boundary boundary = Boundary::clamp;
    double border = 0;
    double scale = 1; ///< of what `in` holds
};

template <class C>
__global__ void __launch_bounds__(driver::block_threads)
    filter_kernel(driver::Rows rows, Pass const pass, driver::DeviceRows in, Index3 in_lower, View<C> out) {
    std::int64_t const row = static_cast<std::int64_t>(blockIdx.x / rows.blocks_per_row) * blockDim.y + threadIdx.y;
    std::int64_t const x = static_cast<std::int64_t>(blockIdx.x % rows.blocks_per_row) * blockDim.x + threadIdx.x;
    if (row >= rows.rows || x >= rows.nx) return;
    std::int64_t const z = driver::quotient_of(row, rows.ny), y = row - z * rows.ny;
    std::int64_t const px = pass.box.lower.x + x, py = pass.box.lower.y + y, pz = pass.box.lower.z + z;
    std::int64_t const along = pass.axis == 0 ? px : pass.axis == 1 ? py : pz;
    std::int64_t const lower = pass.axis == 0 ? in_lower.x : pass.axis == 1 ? in_lower.y : in_lower.z;
    std::int64_t const stride = pass.axis == 0 ? in.size : pass.axis == 1 ? in.row : in.slice;
    // The line's voxel at `lower`.
    std::byte const* const line = in.at(pass.axis == 0 ? 0 : px - in_lower.x, pass.axis == 1 ? 0 : py - in_lower.y,
                                        pass.axis == 2 ? 0 : pz - in_lower.z);
    auto const value = [&](std::int64_t i) {
        std::int64_t const at = fold(i, pass.dims, pass.boundary);
        if (at < 0) return pass.border;
        return pass.scale * driver::load_value<double>(in.type, line + (at - lower) * stride);
    };
    double sum = pass.centre * value(along);
    for (int k = 1; k <= pass.radius; ++k) sum += pass.weight[k] * (value(along - k) + value(along + k));
    out(px, py, pz) = static_cast<C>(sum);
}

template <class C> void filter(Pass const& pass, ConstView in, View<C> out) {
    if (pass.box.empty()) return;
    driver::Rows const rows = driver::rows_of(pass.box.dims(), pass.box.dims().x, 1);
    filter_kernel<C><<<rows.grid, rows.block>>>(rows, pass, driver::device_rows(in, in.box), in.box.lower, out);
    check_launch("bspline_coefficients");
}

template <class C>
void coefficients(ConstView in, AnyView out, Box const& box, Box const& source, SplineFilter const& rule) {
    driver::DeviceList const weights(std::vector<double>(rule.weight, rule.weight + rule.radius + 1));
    auto const pass_along = [&](int axis, Box const& of) {
        bool const none = rule.dims[axis] == 1 && rule.boundary != Boundary::border; // it goes on as it is
        return Pass{of,
                    axis,
                    rule.dims[axis],
                    weights.get(),
                    none ? 0 : static_cast<int>(rule.radius),
                    none ? 1 : rule.weight[0],
                    rule.boundary,
                    rule.border,
                    axis == 2 ? rule.scale : 1}; // the first pass reads voxels, the others what it made of them
    };
    Box columns = source, rows = source;
    columns.lower.z = rows.lower.z = box.lower.z;
    columns.upper.z = rows.upper.z = box.upper.z;
    rows.lower.y = box.lower.y;
    rows.upper.y = box.upper.y;
    driver::DeviceScratch const scratch(static_cast<std::size_t>(rows.voxels()) * sizeof(C));
    AnyView const between = dense_view(scratch.get(), out.type, rows, Space::device);
    filter<C>(pass_along(2, columns), in, out.as<C>());
    filter<C>(pass_along(1, rows), ConstView(out), between.as<C>());
    filter<C>(pass_along(0, box), ConstView(between), out.as<C>());
}

} // namespace

void bspline_coefficients(ConstView in, AnyView out, Box const& box, Box const& source, SplineFilter const& filter,
                          Execution const&) {
    if (out.type == DataType::float32)
        coefficients<float>(in, out, box, source, filter);
    else
        coefficients<double>(in, out, box, source, filter);
}

} // namespace vkt::VKT_BACKEND
