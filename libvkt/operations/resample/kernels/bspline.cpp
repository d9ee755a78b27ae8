// Spline coefficients: a symmetric sum along each axis, a few columns at a time, in vectors across them.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/bspline.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"

#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

constexpr std::int64_t strip = 64, lanes = 16;

/// A line's filter: an axis of one voxel that goes on as it is needs none.
struct Line {
    double const* weight;
    std::int64_t radius;
    Line(SplineFilter const& filter, int axis)
        : weight(filter.weight),
          radius(filter.dims[axis] == 1 && filter.boundary != Boundary::border ? 0 : filter.radius) {}
    double centre() const { return radius == 0 ? 1 : weight[0]; }
};

/// to[i] for i < n: the sum around middle[i], whose neighbours along the line lie `step` values apart. All of `lanes`
/// are computed; n of them are stored.
template <class C> void sum_lanes(Line line, double const* middle, std::int64_t step, std::int64_t n, C* to) {
    double sum[lanes];
    double const centre = line.centre();
#pragma omp simd
    for (std::int64_t i = 0; i < lanes; ++i) sum[i] = centre * middle[i];
    for (std::int64_t k = 1; k <= line.radius; ++k) {
        double const w = line.weight[k];
        double const *const below = middle - k * step, *const above = middle + k * step;
#pragma omp simd
        for (std::int64_t i = 0; i < lanes; ++i) sum[i] += w * (below[i] + above[i]);
    }
    for (std::int64_t i = 0; i < n; ++i) to[i] = static_cast<C>(sum[i]);
}

/// One pass along z or y of a strip of m columns: load(position, row) gives the values at a position inside the volume.
template <class C, class Load, class To>
void filter_columns(Line line, std::int64_t lower, std::int64_t n, std::int64_t dims, SplineFilter const& filter,
                    std::int64_t m, std::vector<double>& scratch, Load const& load, To const& to) {
    scratch.resize(static_cast<std::size_t>((n + 2 * line.radius) * strip));
    for (std::int64_t i = 0; i < n + 2 * line.radius; ++i) {
        std::int64_t const at = fold(lower - line.radius + i, dims, filter.boundary);
        double* const row = scratch.data() + i * strip;
        if (at < 0)
            std::fill_n(row, m, filter.border);
        else
            load(at, row);
    }
    for (std::int64_t i = 0; i < n; ++i) {
        double const* const middle = scratch.data() + (i + line.radius) * strip;
        for (std::int64_t x = 0; x < m; x += lanes)
            sum_lanes(line, middle + x, strip, std::min(lanes, m - x), to(lower + i) + x);
    }
}

template <class C>
void coefficients(ConstView in, AnyView out, Box const& box, Box const& source, SplineFilter const& filter,
                  Execution const& execution) {
    View<C> const to = out.as<C>();
    int const threads = threads_for(execution, box.voxels());
    Index3 const from = source.dims(), n = box.dims();
    std::int64_t const strips = (from.x + strip - 1) / strip;
    Line const along_x(filter, 0), along_y(filter, 1), along_z(filter, 2);
    for_each_item(execution, threads, strips * from.y, [&](std::int64_t begin, std::int64_t end) {
        std::vector<double> scratch;
        for (std::int64_t item = begin; item < end; ++item) {
            std::int64_t const y = source.lower.y + item / strips, x = source.lower.x + item % strips * strip;
            std::int64_t const m = std::min(strip, source.upper.x - x);
            filter_columns<C>(
                along_z, box.lower.z, n.z, filter.dims.z, filter, m, scratch,
                [&](std::int64_t z, double* row) {
                    load_row(in.type, in.at(x, y, z), row, m);
                    if (filter.scale == 1) return;
                    for (std::int64_t i = 0; i < m; ++i) row[i] *= filter.scale;
                },
                [&](std::int64_t z) { return &to(x, y, z); });
        }
    });
    for_each_item(execution, threads, n.z, [&](std::int64_t begin, std::int64_t end) {
        std::vector<double> scratch;
        for (std::int64_t z = box.lower.z + begin; z < box.lower.z + end; ++z) {
            for (std::int64_t x = source.lower.x; x < source.upper.x; x += strip) {
                std::int64_t const m = std::min(strip, source.upper.x - x);
                filter_columns<C>(
                    along_y, box.lower.y, n.y, filter.dims.y, filter, m, scratch,
                    [&](std::int64_t y, double* row) { std::copy_n(&to(x, y, z), m, row); },
                    [&](std::int64_t y) { return &to(x, y, z); });
            }
            std::int64_t const r = along_x.radius;
            scratch.resize(static_cast<std::size_t>(n.x + 2 * r + lanes));
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                for (std::int64_t i = 0; i < n.x + 2 * r; ++i) {
                    std::int64_t const at = fold(box.lower.x - r + i, filter.dims.x, filter.boundary);
                    scratch[static_cast<std::size_t>(i)] = at < 0 ? filter.border : static_cast<double>(to(at, y, z));
                }
                for (std::int64_t i = 0; i < n.x; i += lanes)
                    sum_lanes(along_x, scratch.data() + r + i, 1, std::min(lanes, n.x - i), &to(box.lower.x + i, y, z));
            }
        }
    });
}

} // namespace

void bspline_coefficients(ConstView in, AnyView out, Box const& box, Box const& source, SplineFilter const& filter,
                          Execution const& execution) {
    if (out.type == DataType::float32)
        coefficients<float>(in, out, box, source, filter, execution);
    else
        coefficients<double>(in, out, box, source, filter, execution);
}

} // namespace vkt::VKT_BACKEND
