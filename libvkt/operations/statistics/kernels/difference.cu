// Comparing rows on GPUs: 16 threads a row, one for each of the lanes in which CPUs sum.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/difference.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cuda_rows.h"
#include "libvkt/kernel/kernel.h"

#include <cmath>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int lanes = 16, block = 128;

/// RowDifference without long double: squares are those of differences taken `scale` times.
struct ScaledDifference {
    std::int64_t differing = 0, first = 0;
    double squares = 0, scale = 1, max_abs = 0, low = 0, high = 0;
};

/// One of the two volumes.
struct Side {
    driver::DeviceRows rows;
    double slope, intercept;
    bool mapped, wide; ///< wide: 64-bit integers, which are compared as such

    __device__ __forceinline__ double value(std::int64_t x, std::int64_t y, std::int64_t z) const {
        double const v = driver::load_value<double>(rows.type, rows.at(x, y, z));
        return mapped ? slope * v + intercept : v;
    }
    __device__ __forceinline__ Int128 whole(std::int64_t x, std::int64_t y, std::int64_t z) const {
        std::byte const* const from = rows.at(x, y, z);
        if (rows.type == DataType::int64) return *reinterpret_cast<std::int64_t const*>(from);
        return *reinterpret_cast<std::uint64_t const*>(from);
    }
    __device__ __forceinline__ double stored(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return driver::load_value<double>(rows.type, rows.at(x, y, z));
    }
};

__device__ __forceinline__ double absolute_difference(double a, double b) {
    double const d = a < b ? b - a : a - b;
    bool const equal = a == b || (a != a && b != b);
    return equal ? 0 : d == d ? d : HUGE_VAL;
}
__device__ __forceinline__ double distance(Int128 a, Int128 b) { return static_cast<double>(a < b ? b - a : a - b); }
__device__ inline double distance(Int128 a, double b) {
    if (b != b) return HUGE_VAL;
    if (!(fabs(b) < 0x1p100)) return fabs(b - static_cast<double>(a));
    double const high = trunc(b * 0x1p-50), low = b - high * 0x1p50; // two parts that have room in 64 bits
    Int128 const whole = (static_cast<Int128>(static_cast<std::int64_t>(high)) << 50) + static_cast<std::int64_t>(low);
    return fabs(static_cast<double>(a - whole) - (b - trunc(b)));
}

struct Pair {
    Side a, b;
    Index3 n;
    double slope;

    __device__ __forceinline__ double difference(double va, std::int64_t x, std::int64_t y, std::int64_t z) const {
        if (!a.wide && !b.wide) return absolute_difference(va, b.value(x, y, z));
        double const size = fabs(slope);
        if (a.wide && b.wide) return size * distance(a.whole(x, y, z), b.whole(x, y, z));
        return a.wide ? size * distance(a.whole(x, y, z), b.stored(x, y, z))
                      : size * distance(b.whole(x, y, z), a.stored(x, y, z));
    }
};

__global__ void __launch_bounds__(block) compare_rows(__grid_constant__ Pair const pair, ScaledDifference* out) {
    std::int64_t const row = (static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x) / lanes;
    unsigned const mask = 0xffffu << (threadIdx.x % 32 / lanes * lanes);
    int const lane = static_cast<int>(threadIdx.x % lanes);
    Index3 const n = pair.n;
    if (row >= n.y * n.z) return;
    std::int64_t const z = driver::quotient_of(row, n.y), y = row - z * n.y;
    ScaledDifference r;
    r.low = HUGE_VAL;
    r.high = -HUGE_VAL;
    r.first = n.x;
    for (std::int64_t x = lane; x < n.x; x += lanes) {
        double const a = pair.a.value(x, y, z), d = pair.difference(a, x, y, z);
        r.squares += d * d;
        r.max_abs = d > r.max_abs ? d : r.max_abs;
        r.low = a < r.low && a - a == 0 ? a : r.low;
        r.high = a > r.high && a - a == 0 ? a : r.high;
        if (!(d > 0)) continue;
        ++r.differing;
        if (r.first > x) r.first = x;
    }
    double squares = 0;
    for (int j = 0; j < lanes; ++j) squares += __shfl_sync(mask, r.squares, j, lanes);
    r.squares = squares;
    for (int half = lanes / 2; half > 0; half /= 2) {
        r.differing += __shfl_down_sync(mask, r.differing, half, lanes);
        std::int64_t const first = __shfl_down_sync(mask, r.first, half, lanes);
        double const largest = __shfl_down_sync(mask, r.max_abs, half, lanes),
                     low = __shfl_down_sync(mask, r.low, half, lanes),
                     high = __shfl_down_sync(mask, r.high, half, lanes);
        r.first = first < r.first ? first : r.first;
        r.max_abs = largest > r.max_abs ? largest : r.max_abs;
        r.low = low < r.low ? low : r.low;
        r.high = high > r.high ? high : r.high;
    }
    if (lane != 0) return;
    if (r.differing == 0) r.first = 0;
    // Squares of differences that double has no room for, or nearly none, are summed once more.
    if (squares - squares != 0)
        r.scale = 0x1p-600;
    else if (r.max_abs > 0 && r.max_abs < 0x1p-450)
        r.scale = 0x1p600;
    if (r.scale != 1) {
        r.squares = 0;
        for (std::int64_t x = 0; x < n.x; ++x) {
            double const d = absolute_difference(pair.a.value(x, y, z) * r.scale, pair.b.value(x, y, z) * r.scale);
            r.squares += d * d;
        }
    }
    out[row] = r;
}

bool is_wide(DataType type) { return type == DataType::int64 || type == DataType::uint64; }

} // namespace

void difference_rows(SlabPair const& pair, RowDifference* rows, Execution const& execution) {
    Index3 const n = pair.a.dims();
    std::int64_t const count = n.y * n.z;
    unsigned const blocks = launch_blocks((count * lanes + block - 1) / block);
    bool const same_map = pair.map_a == pair.map_b; // its intercept takes no part
    auto const side = [&](ConstView const& view, ValueMap const& map) {
        return Side{driver::device_rows(view, view.box), map.slope, map.intercept, !(map == ValueMap{}),
                    same_map && is_wide(view.type)};
    };
    Buffer memory(static_cast<std::size_t>(count) * sizeof(ScaledDifference));
    auto* const found = reinterpret_cast<ScaledDifference*>(memory.write(Space::device));
    compare_rows<<<blocks, block>>>(Pair{side(pair.a, pair.map_a), side(pair.b, pair.map_b), n, pair.map_a.slope},
                                    found);
    check_launch("difference");
    auto const* const results = reinterpret_cast<ScaledDifference const*>(memory.read(Space::host));
#pragma omp parallel for num_threads(execution.threads) if (execution.threads > 1)
    for (std::int64_t i = 0; i < count; ++i) {
        ScaledDifference const& r = results[i];
        auto const scale = static_cast<long double>(r.scale);
        rows[i] = {r.differing,
                   r.differing > 0 ? pair.a.box.lower.x + r.first : 0,
                   r.squares / (scale * scale),
                   r.max_abs,
                   r.low,
                   r.high};
    }
}

} // namespace VKT_BACKEND

} // namespace vkt
