// Statistics of bands of rows on GPUs: 16 threads a band, one for each of the lanes in which CPUs sum.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/statistics.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/kernels/statistics_bands.h"

#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int lanes = statistics_lanes;
constexpr int block = 128;
constexpr std::int64_t product_chunk = 2048; ///< of how many voxels CPUs multiply small integers together

/// A slab cut into bands, as BandStatistics has it.
struct Bands {
    std::int64_t length, rows, pitch, slice; ///< voxels; rows of a band; voxels between rows and slices
    std::int64_t ny, per_slice, count;
};

template <class T> struct DeviceBand {
    T const* voxels;
    std::int64_t length, rows, pitch;
};

template <class T> __device__ DeviceBand<T> band_at(T const* in, Bands const& bands, std::int64_t b) {
    std::int64_t const z = driver::quotient_of(b, bands.per_slice), y = (b - z * bands.per_slice) * bands.rows;
    return {in + y * bands.pitch + z * bands.slice, bands.length, min(bands.rows, bands.ny - y), bands.pitch};
}
/// Rows that end where a lane begins fill the lanes the same way when they are one long row.
template <class T> __device__ DeviceBand<T> joined(DeviceBand<T> band) {
    if (band.length == band.pitch && band.length % lanes == 0) band = {band.voxels, band.length * band.rows, 1, 0};
    return band;
}

struct Lane {
    unsigned mask; ///< of the band's threads
    int index;
    std::int64_t band;
};
__device__ inline Lane this_lane() {
    unsigned const half = threadIdx.x % 32 / lanes;
    return {0xffffu << (lanes * half), static_cast<int>(threadIdx.x % lanes),
            (static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x) / lanes};
}
/// The band's lanes added as CPUs do, in the first of them.
__device__ inline double folded(double v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) v += __shfl_down_sync(lane.mask, v, half, lanes);
    return v;
}
template <class V> __device__ V added(V v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) v += __shfl_down_sync(lane.mask, v, half, lanes);
    return v;
}
template <class V> __device__ V least(V v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) {
        V const other = __shfl_down_sync(lane.mask, v, half, lanes);
        v = other < v ? other : v;
    }
    return v;
}
template <class V> __device__ V most(V v, Lane const& lane) {
    for (int half = lanes / 2; half > 0; half /= 2) {
        V const other = __shfl_down_sync(lane.mask, v, half, lanes);
        v = v < other ? other : v;
    }
    return v;
}

template <class T> __device__ bool is_finite(T v) { return v - v == T(0); }

/// The first finite value of a band, 0 if there is none; the same in all lanes.
template <class T> __device__ double shift_of(DeviceBand<T> const& band, Lane const& lane) {
    for (std::int64_t r = 0; r < band.rows; ++r)
        for (std::int64_t begin = 0; begin < band.length; begin += lanes) {
            std::int64_t const i = begin + lane.index;
            double const v = i < band.length ? static_cast<double>(band.voxels[r * band.pitch + i]) : HUGE_VAL;
            unsigned const finite = __ballot_sync(lane.mask, is_finite(v)) & lane.mask;
            if (finite != 0) return __shfl_sync(lane.mask, v, (__ffs(static_cast<int>(finite)) - 1) % lanes, lanes);
        }
    return 0;
}

/// Calls f(value) for the voxels of this lane: those of whole groups of 16 first, then tail(value) for the others.
template <class T, class F, class Tail>
__device__ void for_lane(DeviceBand<T> const& band, Lane const& lane, F const& f, Tail const& tail) {
    constexpr int together = 8;
    std::int64_t const whole = band.length / lanes * lanes;
    for (std::int64_t r = 0; r < band.rows; ++r) {
        T const* const row = band.voxels + r * band.pitch;
        std::int64_t i = lane.index;
        for (; i + (together - 1) * lanes < whole; i += together * lanes) {
            T v[together];
#pragma unroll
            for (int k = 0; k < together; ++k) v[k] = row[i + k * lanes];
#pragma unroll
            for (int k = 0; k < together; ++k) f(v[k]);
        }
        for (; i < whole; i += lanes) f(row[i]);
        if (i < band.length) tail(row[i]);
    }
}

/// Sums in which nothing is known of what is not finite.
struct LaneSums {
    double s = 0, q = 0, tail_s = 0, tail_q = 0;
};
template <class T>
__device__ LaneSums sums_of(DeviceBand<T> const& band, Lane const& lane, double shift, double scale) {
    LaneSums sums;
    double const scaled = shift * scale;
    auto const difference = [&](T v) {
        double const wide = static_cast<double>(v);
        return is_finite(wide) ? wide * scale - scaled : 0.0;
    };
    for_lane(
        band, lane,
        [&](T v) {
            double const d = difference(v);
            sums.s += d;
            sums.q += d * d;
        },
        [&](T v) {
            double const d = difference(v);
            sums.tail_s += d;
            sums.tail_q += d * d;
        });
    return sums;
}

template <class T> __global__ void __launch_bounds__(block) float_bands(T const* in, Bands bands, FloatBand* out) {
    Lane const lane = this_lane();
    if (lane.band >= bands.count) return;
    DeviceBand<T> const as_it_is = band_at(in, bands, lane.band), band = joined(as_it_is);
    double const shift = shift_of(as_it_is, lane);
    FloatBand result;
    unsigned nan = 0, above = 0, below = 0;
    double low = HUGE_VAL, high = -HUGE_VAL;
    auto const look = [&](T voxel) {
        double const v = static_cast<double>(voxel);
        nan += v != v ? 1 : 0;
        above += v == HUGE_VAL ? 1 : 0;
        below += v == -HUGE_VAL ? 1 : 0;
        low = v < low ? v : low;
        high = v > high ? v : high;
    };
    LaneSums sums;
    auto const add = [&](T v, double& s, double& q) {
        double const wide = static_cast<double>(v), d = is_finite(wide) ? wide - shift : 0.0;
        s += d;
        q += d * d;
        look(v);
    };
    for_lane(
        band, lane, [&](T v) { add(v, sums.s, sums.q); }, [&](T v) { add(v, sums.tail_s, sums.tail_q); });
    result.scale = 1;
    if constexpr (std::is_same_v<T, double>) {
        // As CPUs decide: sums, differences or squares beyond double, or squares so small that they may be lost.
        double const count = static_cast<double>(as_it_is.length * as_it_is.rows);
        double s = count * shift, q = 0;
        for (int j = 0; j < lanes; ++j) {
            s += __shfl_sync(lane.mask, sums.s, j, lanes) + __shfl_sync(lane.mask, sums.tail_s, j, lanes);
            q += __shfl_sync(lane.mask, sums.q, j, lanes) + __shfl_sync(lane.mask, sums.tail_q, j, lanes);
        }
        double const all_low = __shfl_sync(lane.mask, least(low, lane), 0, lanes),
                     all_high = __shfl_sync(lane.mask, most(high, lane), 0, lanes);
        bool const constant = !(all_low < shift) && !(all_high > shift);
        if (!is_finite(s) || !is_finite(q) || (q < 0x1p-900 && !constant)) {
            double const size = fmax(fabs(all_low), fabs(all_high));
            result.scale = size > 1 ? 0x1p-600 : 0x1p600;
            sums = sums_of(band, lane, shift, result.scale);
        }
    }
    result.count = as_it_is.length * as_it_is.rows;
    result.nan = added(nan, lane);
    result.above = added(above, lane);
    result.below = added(below, lane);
    result.sum = folded(sums.s + sums.tail_s, lane);
    result.squares = folded(sums.q + sums.tail_q, lane);
    result.shift = shift;
    result.low = least(low, lane);
    result.high = most(high, lane);
    if (lane.index == 0) out[lane.band] = result;
}

template <class T> __global__ void __launch_bounds__(block) integer_bands(T const* in, Bands bands, IntegerBand* out) {
    Lane const lane = this_lane();
    if (lane.band >= bands.count) return;
    DeviceBand<T> const band = band_at(in, bands, lane.band);
    T const first = band.voxels[0];
    T low = first, high = first;
    std::int64_t sum = 0;
    std::uint64_t squares_low = 0, squares_high = 0;
    auto const add = [&](T voxel) {
        low = voxel < low ? voxel : low;
        high = voxel > high ? voxel : high;
        auto const v = static_cast<std::int64_t>(voxel);
        sum += v;
        auto const size = static_cast<std::uint64_t>(v < 0 ? -v : v);
        std::uint64_t const square = size * size;
        squares_low += square & 0xffffffffu;
        squares_high += square >> 32;
    };
    for_lane(band, lane, add, add);
    IntegerBand result;
    result.count = band.length * band.rows;
    result.low = static_cast<std::int64_t>(least(low, lane));
    result.high = static_cast<std::int64_t>(most(high, lane));
    result.sum = added(sum, lane);
    result.squares_low = added(squares_low, lane);
    result.squares_high = added(squares_high, lane);
    if (lane.index == 0) out[lane.band] = result;
}

template <class T> __global__ void __launch_bounds__(block) wide_bands(T const* in, Bands bands, IntegerBand* out) {
    Lane const lane = this_lane();
    if (lane.band >= bands.count) return;
    DeviceBand<T> const band = band_at(in, bands, lane.band);
    T const first = band.voxels[0];
    T low = first, high = first;
    Int128 sum = 0;
    double s = 0, q = 0;
    for (std::int64_t r = 0; r < band.rows; ++r)
        for (std::int64_t begin = 0; begin < band.length; begin += lanes) {
            std::int64_t const i = begin + lane.index;
            bool const valid = i < band.length;
            T const v = valid ? band.voxels[r * band.pitch + i] : first;
            low = v < low ? v : low;
            high = v > high ? v : high;
            if (valid) sum += static_cast<Int128>(v);
            // What is beyond the row adds 0.
            double const d = static_cast<double>(static_cast<Int128>(v) - static_cast<Int128>(first));
            for (int j = 0; j < lanes; ++j) {
                double const next = __shfl_sync(lane.mask, d, j, lanes);
                s += next;
                q += next * next;
            }
        }
    IntegerBand result;
    result.count = band.length * band.rows;
    result.low = static_cast<std::int64_t>(least(low, lane));
    result.high = static_cast<std::int64_t>(most(high, lane));
    result.first = static_cast<std::int64_t>(first);
    auto lower = static_cast<std::uint64_t>(sum);
    auto upper = static_cast<std::uint64_t>(sum >> 64);
    for (int half = lanes / 2; half > 0; half /= 2) {
        std::uint64_t const other = __shfl_down_sync(lane.mask, lower, half, lanes),
                            carried = __shfl_down_sync(lane.mask, upper, half, lanes);
        lower += other;
        upper += carried + (lower < other ? 1 : 0);
    }
    result.sum = static_cast<Int128>(static_cast<Unsigned128>(upper) << 64 | lower);
    result.s = s;
    result.q = q;
    if (lane.index == 0) out[lane.band] = result;
}

/// Moves the exponent of a normal number from the one to the other.
__device__ void split(double& number, std::int64_t& exponent) {
    if (number == 0) return;
    auto const bits = static_cast<std::uint64_t>(__double_as_longlong(number));
    exponent += static_cast<std::int64_t>(bits >> 52 & 0x7ff) - 1023;
    number = __longlong_as_double(
        static_cast<std::int64_t>((bits & ~(std::uint64_t{0x7ff} << 52)) | std::uint64_t{1023} << 52));
}
__device__ void multiply(LaneProduct& product, double factor) {
    if (fabs(factor) < 0x1p-900) { // perhaps subnormal
        factor *= 0x1p200;
        product.exponent -= 200;
    }
    split(factor, product.exponent);
    product.mantissa *= factor;
    split(product.mantissa, product.exponent);
}

/// A factor a host takes as long double: rounded to 64 bits, to even.
__device__ void multiply(BandProduct& product, LaneProduct const& factor) {
    auto const bits = static_cast<std::uint64_t>(__double_as_longlong(factor.mantissa));
    std::uint64_t const digits = (bits << 11) | std::uint64_t{1} << 63;
    std::uint64_t high = __umul64hi(product.mantissa, digits), low = product.mantissa * digits;
    product.exponent += factor.exponent;
    product.negative ^= static_cast<std::int64_t>(bits >> 63);
    if (high >> 63 != 0) {
        ++product.exponent;
    } else {
        high = high << 1 | low >> 63;
        low <<= 1;
    }
    constexpr std::uint64_t half = std::uint64_t{1} << 63;
    if (low > half || (low == half && (high & 1) != 0)) ++high;
    if (high == 0) {
        high = half;
        ++product.exponent;
    }
    product.mantissa = high;
}

/// Products of bands, in the order in which CPUs multiply.
template <class T>
__global__ void __launch_bounds__(block)
    product_bands(T const* in, Bands bands, bool mapped, double slope, double intercept, BandProduct* out) {
    Lane const lane = this_lane();
    if (lane.band >= bands.count) return;
    DeviceBand<T> const band = band_at(in, bands, lane.band);
    LaneProduct product;
    bool zero = false;
    for (std::int64_t r = 0; r < band.rows && !zero; ++r)
        for (std::int64_t begin = 0; begin < band.length && !zero; begin += product_chunk) {
            T const* const p = band.voxels + r * band.pitch + begin;
            std::int64_t const n = min(product_chunk, band.length - begin);
            if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
                if (!mapped) {
                    constexpr std::int64_t factors = 6 / sizeof(T);
                    std::int64_t const each = n / factors, all = each + n - each * factors;
                    for (std::int64_t i = lane.index; i < all; i += lanes) {
                        double value = static_cast<double>(p[i < each ? i : i + each * (factors - 1)]);
                        for (std::int64_t k = 1; k < factors && i < each; ++k)
                            value *= static_cast<double>(p[i + k * each]);
                        multiply(product, value);
                    }
                    zero = __any_sync(lane.mask, product.mantissa == 0);
                    continue;
                }
            }
            for (std::int64_t i = lane.index; i < n; i += lanes) {
                double const stored = static_cast<double>(p[i]);
                double value = stored;
                if (mapped) {
                    value = slope * stored + intercept;
                    if (!is_finite(value)) value = fma(slope, stored, intercept);
                }
                if (is_finite(value)) multiply(product, value);
            }
            zero = __any_sync(lane.mask, product.mantissa == 0);
        }
    BandProduct all;
    for (int j = 0; j < lanes; ++j)
        multiply(all, LaneProduct{__shfl_sync(lane.mask, product.mantissa, j, lanes),
                                  __shfl_sync(lane.mask, product.exponent, j, lanes)});
    if (lane.index == 0) out[lane.band] = zero ? BandProduct{0, 0, 0} : all;
}

// Kernels are launched from function templates: those that only a generic lambda instantiates are not found.
template <class T, class Band> Band const* launch_bands(T const* in, Bands const& bands, Buffer& memory) {
    memory.reserve(static_cast<std::size_t>(bands.count) * sizeof(Band));
    auto* const out = reinterpret_cast<Band*>(memory.write(Space::device));
    auto const blocks = static_cast<unsigned>((bands.count * lanes + block - 1) / block);
    if constexpr (!std::is_integral_v<T>)
        float_bands<T><<<blocks, block>>>(in, bands, out);
    else if constexpr (sizeof(T) <= 4)
        integer_bands<T><<<blocks, block>>>(in, bands, out);
    else
        wide_bands<T><<<blocks, block>>>(in, bands, out);
    check_launch("statistics");
    return reinterpret_cast<Band const*>(memory.read(Space::host));
}

template <class T>
BandProduct const* launch_products(T const* in, Bands const& bands, ValueMap const& map, Buffer& memory) {
    memory.reserve(static_cast<std::size_t>(bands.count) * sizeof(BandProduct));
    auto* const out = reinterpret_cast<BandProduct*>(memory.write(Space::device));
    auto const blocks = static_cast<unsigned>((bands.count * lanes + block - 1) / block);
    product_bands<T><<<blocks, block>>>(in, bands, !(map == ValueMap{}), map.slope, map.intercept, out);
    check_launch("products");
    return reinterpret_cast<BandProduct const*>(memory.read(Space::host));
}

template <class T>
void bands_of(ConstView slab, Bands const& bands, MeanOrigin const& origin, ValueMap const* product_map,
              BandStatistics* to, int threads) {
    using Band = std::conditional_t<std::is_integral_v<T>, IntegerBand, FloatBand>;
    auto const* const in = reinterpret_cast<T const*>(slab.data);
    Buffer memory;
    finish_bands(launch_bands<T, Band>(in, bands, memory), bands.count, slab.type, origin, to, threads);
    if (product_map != nullptr)
        finish_products(launch_products(in, bands, *product_map, memory), bands.count, to, threads);
}

} // namespace

void band_statistics(ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, BandStatistics* bands,
                     Execution const& execution) {
    Index3 const n = slab.dims();
    std::int64_t const per_slice = bands_in_slice(n, slab.type);
    Bands const cut{n.x, rows_in_band(n, slab.type), slab.row, slab.slice, n.y, per_slice, per_slice * n.z};
    for_each_type(slab.type,
                  [&]<class T>(T) { bands_of<T>(slab, cut, origin, product_map, bands, execution.threads); });
}

} // namespace VKT_BACKEND

} // namespace vkt
