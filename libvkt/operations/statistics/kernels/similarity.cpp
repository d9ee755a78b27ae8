// Windowed sums of values, squares and products: along x and y plane by plane, then along z.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/similarity.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/physical_values.h"

#include <algorithm>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int fields = 5; // a, b, aa, bb, ab

/// One plane's windowed fields, along x and then y.
void filter_plane(WindowedPair const& p, std::int64_t z, std::vector<double>& scratch) {
    Index3 const n = p.inner.dims(), lower = p.inner.lower - p.radius;
    std::int64_t const width = n.x + 2 * p.radius.x, rows = n.y + 2 * p.radius.y;
    scratch.resize(static_cast<std::size_t>(3 * width + fields * n.x * rows));
    double *const a = scratch.data(), *const b = a + width, *const product = b + width;
    double* const along_x = product + width;
    for (std::int64_t y = 0; y < rows; ++y) {
        Index3 const at = lower + Index3{0, y, z};
        load_values(p.a, at, width, p.map_a, a);
        load_values(p.b, at, width, p.map_b, b);
#pragma omp simd
        for (std::int64_t x = 0; x < width; ++x) {
            a[x] -= p.offset;
            b[x] -= p.offset;
        }
        for (int f = 0; f < fields; ++f) {
            double const* const one = f == 1 || f == 3 ? b : a;
            double const* const other = f == 2 ? a : b;
#pragma omp simd
            for (std::int64_t x = 0; x < width; ++x) product[x] = f < 2 ? one[x] : one[x] * other[x];
            double const* const middle = product + p.radius.x;
            double* const to = along_x + (f * rows + y) * n.x;
#pragma omp simd
            for (std::int64_t x = 0; x < n.x; ++x) to[x] = p.radius.x > 0 ? p.weights[0] * middle[x] : middle[x];
            for (std::int64_t k = 1; k <= p.radius.x; ++k)
#pragma omp simd
                for (std::int64_t x = 0; x < n.x; ++x) to[x] += p.weights[k] * (middle[x - k] + middle[x + k]);
        }
    }
    for (int f = 0; f < fields; ++f)
        for (std::int64_t y = 0; y < n.y; ++y) {
            double const* const middle = along_x + (f * rows + y + p.radius.y) * n.x;
            double* const to = p.planes + ((z * fields + f) * n.y + y) * n.x;
#pragma omp simd
            for (std::int64_t x = 0; x < n.x; ++x) to[x] = p.radius.y > 0 ? p.weights[0] * middle[x] : middle[x];
            for (std::int64_t k = 1; k <= p.radius.y; ++k)
#pragma omp simd
                for (std::int64_t x = 0; x < n.x; ++x)
                    to[x] += p.weights[k] * (middle[x - k * n.x] + middle[x + k * n.x]);
        }
}

/// Of the segments of one row.
void sum_indices(WindowedPair const& p, std::int64_t y, std::int64_t z, std::vector<double>& scratch, double* sums) {
    Index3 const n = p.inner.dims();
    scratch.resize(static_cast<std::size_t>((fields + 1) * n.x));
    for (int f = 0; f < fields; ++f) {
        auto const plane = [&](std::int64_t k) {
            return p.planes + (((z + p.radius.z + k) * fields + f) * n.y + y) * n.x;
        };
        double* const to = scratch.data() + f * n.x;
        double const* const middle = plane(0);
#pragma omp simd
        for (std::int64_t x = 0; x < n.x; ++x) to[x] = p.radius.z > 0 ? p.weights[0] * middle[x] : middle[x];
        for (std::int64_t k = 1; k <= p.radius.z; ++k) {
            double const *const below = plane(-k), *const above = plane(k);
#pragma omp simd
            for (std::int64_t x = 0; x < n.x; ++x) to[x] += p.weights[k] * (below[x] + above[x]);
        }
    }
    double const* const s = scratch.data();
    double* const index = scratch.data() + fields * n.x;
#pragma omp simd
    for (std::int64_t x = 0; x < n.x; ++x) {
        double const a = s[x], b = s[n.x + x];
        double const va = s[2 * n.x + x] - a * a, vb = s[3 * n.x + x] - b * b, vab = s[4 * n.x + x] - a * b;
        double const ua = a + p.offset, ub = b + p.offset;
        double const above = (2 * ua * ub + p.c1) * (2 * vab + p.c2);
        double const below = (ua * ua + ub * ub + p.c1) * (va + vb + p.c2);
        index[x] = below == 0 ? 1 : above / below; // two zeros
    }
    for (std::int64_t x = 0; x < n.x; ++sums) {
        std::int64_t const end = std::min(x + similarity_segment, n.x);
        *sums = 0;
        for (; x < end; ++x) *sums += index[x];
    }
}

} // namespace

void similarity_rows(WindowedPair const& pair, double* rows, Execution const& execution) {
    Index3 const n = pair.inner.dims();
    std::int64_t const segments = (n.x + similarity_segment - 1) / similarity_segment;
    int const threads = threads_for(execution, box_of(n).voxels());
    for_each_item(execution, threads, n.z + 2 * pair.radius.z, [&](std::int64_t begin, std::int64_t end) {
        std::vector<double> scratch;
        for (std::int64_t z = begin; z < end; ++z) filter_plane(pair, z, scratch);
    });
    for_each_item(execution, threads, n.y * n.z, [&](std::int64_t begin, std::int64_t end) {
        std::vector<double> scratch;
        for (std::int64_t r = begin; r < end; ++r) sum_indices(pair, r % n.y, r / n.y, scratch, rows + r * segments);
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
