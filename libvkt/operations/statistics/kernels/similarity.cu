// Windowed sums on GPUs: along x, y and z one after the other, each sum in the order of CPUs, which gives their bits.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/similarity.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/physical_values.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int fields = 5; // a, b, aa, bb, ab
static_assert(similarity_segment == 32, "a warp sums up a segment");

/// One volume's values, x fastest.
struct ValuesOf {
    driver::DeviceRows rows;
    Index3 n;
    bool mapped;
    double slope, intercept, offset;
    double* to;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        double const stored = driver::load_value<double>(rows.type, rows.at(x, y, z));
        to[(z * n.y + y) * n.x + x] = (mapped ? physical_value(stored, slope, intercept) : stored) - offset;
    }
};

struct Weights {
    double w[window_radius + 1];
};

/// The windowed sum around what `at` points to; values(i) is i steps away.
template <class F>
__device__ __forceinline__ double windowed(Weights const& weights, std::int64_t radius, F const& values) {
    if (radius == 0) return values(0);
    double sum = weights.w[0] * values(0);
    for (std::int64_t k = 1; k <= radius; ++k) sum += weights.w[k] * (values(-k) + values(k));
    return sum;
}

/// Fields of n.x by n.y by n.z sums along x, one field after another.
struct AlongX {
    double const *a, *b; ///< n.x + 2 radius values a row
    Index3 n;
    std::int64_t radius;
    Weights weights;
    double* to;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        std::int64_t const row = z * n.y + y, field = n.x * n.y * n.z;
        double const* const va = a + row * (n.x + 2 * radius) + radius + x;
        double const* const vb = b + row * (n.x + 2 * radius) + radius + x;
        double* const out = to + row * n.x + x;
        out[0] = windowed(weights, radius, [&](std::int64_t i) { return va[i]; });
        out[field] = windowed(weights, radius, [&](std::int64_t i) { return vb[i]; });
        out[2 * field] = windowed(weights, radius, [&](std::int64_t i) { return va[i] * va[i]; });
        out[3 * field] = windowed(weights, radius, [&](std::int64_t i) { return vb[i] * vb[i]; });
        out[4 * field] = windowed(weights, radius, [&](std::int64_t i) { return va[i] * vb[i]; });
    }
};

/// The planes of all fields along y.
struct AlongY {
    double const* from; ///< planes of n.y + 2 radius rows
    Index3 n;
    std::int64_t radius;
    Weights weights;
    double* to;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        double const* const middle = from + (z * (n.y + 2 * radius) + radius + y) * n.x + x;
        to[(z * n.y + y) * n.x + x] = windowed(weights, radius, [&](std::int64_t i) { return middle[i * n.x]; });
    }
};

/// What is left along z, and the index.
struct Indices {
    double const* planes; ///< n.z + 2 radius of them a field
    Index3 n;
    std::int64_t radius;
    Weights weights;
    double offset, c1, c2;

    __device__ __forceinline__ double operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        std::int64_t const plane = n.x * n.y, field = plane * (n.z + 2 * radius);
        double const* const at = planes + (z + radius) * plane + y * n.x + x;
        double s[fields];
#pragma unroll
        for (int f = 0; f < fields; ++f)
            s[f] = windowed(weights, radius, [&](std::int64_t i) { return at[f * field + i * plane]; });
        double const a = s[0], b = s[1];
        double const va = s[2] - a * a, vb = s[3] - b * b, vab = s[4] - a * b;
        double const ua = a + offset, ub = b + offset;
        double const above = (2 * ua * ub + c1) * (2 * vab + c2);
        double const below = (ua * ua + ub * ub + c1) * (va + vb + c2);
        return below == 0 ? 1 : above / below; // two zeros
    }
};

constexpr unsigned sum_threads = 128;

/// A warp a segment of a row.
__global__ void __launch_bounds__(sum_threads)
    sum_segments(__grid_constant__ Indices const index, std::int64_t segments, double* sums) {
    Index3 const n = index.n;
    std::int64_t const which = static_cast<std::int64_t>(blockIdx.x) * (sum_threads / 32) + threadIdx.x / 32;
    if (which >= segments * n.y * n.z) return;
    std::int64_t const row = driver::quotient_of(which, segments), z = driver::quotient_of(row, n.y), y = row - z * n.y;
    std::int64_t const first = (which - row * segments) * similarity_segment, x = first + threadIdx.x % 32;
    std::int64_t const left = n.x - first;
    double const mine = x < n.x ? index(x, y, z) : 0;
    double sum = 0;
    for (int lane = 0; lane < 32 && lane < left; ++lane) sum += __shfl_sync(0xffffffffu, mine, lane);
    if (threadIdx.x % 32 == 0) sums[which] = sum;
}

class DeviceDoubles {
public:
    explicit DeviceDoubles(std::int64_t count) : memory_(static_cast<std::size_t>(count) * sizeof(double)) {}
    double* get() const { return reinterpret_cast<double*>(memory_.get()); }

private:
    driver::DeviceScratch memory_;
};

void load_values_of(ConstView view, Box const& box, ValueMap const& map, double offset, double* to) {
    bool const mapped = !(map.slope == 1 && map.intercept == 0);
    driver::for_each_voxel(
        box.dims(), ValuesOf{driver::device_rows(view, box), box.dims(), mapped, map.slope, map.intercept, offset, to},
        nullptr, "values");
}

} // namespace

void similarity_rows(WindowedPair const& pair, double* rows, Execution const&) {
    Index3 const n = pair.inner.dims(), r = pair.radius;
    Box const box{pair.inner.lower - r, pair.inner.upper + r};
    Index3 const whole = box.dims();
    Weights weights;
    for (std::int64_t k = 0; k <= window_radius; ++k) weights.w[k] = pair.weights[k];

    DeviceDoubles const a(box.voxels()), b(box.voxels());
    load_values_of(pair.a, box, pair.map_a, pair.offset, a.get());
    load_values_of(pair.b, box, pair.map_b, pair.offset, b.get());
    DeviceDoubles const along_x(fields * n.x * whole.y * whole.z), planes(fields * n.x * n.y * whole.z);
    Index3 const rows_of_planes{n.x, whole.y, whole.z};
    driver::for_each_voxel(rows_of_planes, AlongX{a.get(), b.get(), rows_of_planes, r.x, weights, along_x.get()},
                           nullptr, "windows along x");
    Index3 const all_planes{n.x, n.y, fields * whole.z};
    driver::for_each_voxel(all_planes, AlongY{along_x.get(), all_planes, r.y, weights, planes.get()}, nullptr,
                           "windows along y");
    std::int64_t const segments = (n.x + similarity_segment - 1) / similarity_segment, count = segments * n.y * n.z;
    std::int64_t const per_block = sum_threads / 32;
    DeviceDoubles const sums(count);
    sum_segments<<<static_cast<unsigned>((count + per_block - 1) / per_block), sum_threads>>>(
        Indices{planes.get(), n, r.z, weights, pair.offset, pair.c1, pair.c2}, segments, sums.get());
    check_launch("similarity");
    copy_to_host(rows, sums.get(), static_cast<std::size_t>(count) * sizeof(double));
}

} // namespace VKT_BACKEND

} // namespace vkt
