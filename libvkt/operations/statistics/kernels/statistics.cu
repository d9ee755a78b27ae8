// Statistics of bands of rows on GPUs: 16 threads a band, one for each of the lanes in which CPUs sum.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/statistics.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/statistics_bands.h"

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

/// What a band has on its way from global memory: pieces of 1 KiB, two of which are being copied while one is read.
/// 64 bytes more, so that the two bands of a warp are read from different banks.
struct Ring {
    static constexpr int piece = 1024, pieces = 3, bytes = pieces * piece + 64;
    std::byte* memory;

    __device__ __forceinline__ static Ring of_band() {
        __shared__ alignas(16) std::byte rings[block / lanes][bytes];
        return {rings[threadIdx.x / lanes]};
    }
    __device__ __forceinline__ std::byte* slot(unsigned number) const { return memory + number % pieces * piece; }
    /// Every call is one group of copies, also of nothing.
    __device__ __forceinline__ void copy(std::byte const* from, unsigned number, unsigned count, int lane) const {
        if (number < count) {
            auto const to = static_cast<unsigned>(__cvta_generic_to_shared(slot(number))) + 16 * lane;
#pragma unroll
            for (int k = 0; k < piece; k += 16 * lanes)
                asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(to + k),
                             "l"(from + static_cast<std::int64_t>(number) * piece + 16 * lane + k));
        }
        asm volatile("cp.async.commit_group;" ::: "memory");
    }
    /// All but the last group of copies is there.
    __device__ __forceinline__ static void wait(unsigned mask) {
        asm volatile("cp.async.wait_group 1;" ::: "memory");
        __syncwarp(mask);
    }
};

/// Calls f(values) for the voxels of this lane, some at once: those of whole groups of 16 first, then tail(value) for
/// the others.
template <class T, class F, class Tail>
__device__ void for_lane(DeviceBand<T> const& band, Lane const& lane, F const& f, Tail const& tail) {
    constexpr int together = 8, in_piece = Ring::piece / static_cast<int>(sizeof(T)), each = in_piece / lanes;
    std::int64_t const whole = band.length / lanes * lanes;
    Ring const ring = Ring::of_band();
    for (std::int64_t r = 0; r < band.rows; ++r) {
        T const* const row = band.voxels + r * band.pitch;
        std::int64_t i = lane.index;
        if (reinterpret_cast<std::uintptr_t>(row) % 16 == 0) {
            auto const* const from = reinterpret_cast<std::byte const*>(row);
            auto const count = static_cast<unsigned>(whole / in_piece);
            __syncwarp(lane.mask); // the ring has been read
            ring.copy(from, 0, count, lane.index);
            ring.copy(from, 1, count, lane.index);
            for (unsigned number = 0; number < count; ++number) {
                Ring::wait(lane.mask);
                ring.copy(from, number + 2, count, lane.index);
                T const* const piece = reinterpret_cast<T const*>(ring.slot(number)) + lane.index;
#pragma unroll 2
                for (int k = 0; k < each; k += together) {
                    T v[together];
#pragma unroll
                    for (int j = 0; j < together; ++j) v[j] = piece[(k + j) * lanes];
                    f(v);
                }
            }
            i += static_cast<std::int64_t>(count) * in_piece;
        }
        for (; i + (together - 1) * lanes < whole; i += together * lanes) {
            T v[together];
#pragma unroll
            for (int k = 0; k < together; ++k) v[k] = row[i + k * lanes];
            f(v);
        }
        for (; i < whole; i += lanes) {
            T const v[1] = {row[i]};
            f(v);
        }
        if (i < band.length) tail(row[i]);
    }
}
/// The same one by one.
template <class T, class F> __device__ void for_each_of_lane(DeviceBand<T> const& band, Lane const& lane, F const& f) {
    for_lane(
        band, lane,
        [&]<int N>(T const(&v)[N]) {
#pragma unroll
            for (int k = 0; k < N; ++k) f(v[k]);
        },
        f);
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
        [&]<int N>(T const(&v)[N]) {
            for (int k = 0; k < N; ++k) {
                double const d = difference(v[k]);
                sums.s += d;
                sums.q += d * d;
            }
        },
        [&](T v) {
            double const d = difference(v);
            sums.tail_s += d;
            sums.tail_q += d * d;
        });
    return sums;
}

/// Moves the exponent of a normal number, or of 0, from the one to the other.
__device__ __forceinline__ void split(double& number, std::int64_t& exponent) {
    int const high = __double2hiint(number);
    if ((high & 0x7fffffff) == 0) return;
    exponent += (high >> 20 & 0x7ff) - 1023;
    number = __hiloint2double((high & static_cast<int>(0x800fffff)) | 0x3ff00000, __double2loint(number));
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
__device__ void multiply(BandProduct& product, BandProduct const& factor) {
    if (product.mantissa == 0 || factor.mantissa == 0) {
        product = {0, 0, 0};
        return;
    }
    std::uint64_t high = __umul64hi(product.mantissa, factor.mantissa), low = product.mantissa * factor.mantissa;
    product.exponent += factor.exponent;
    product.negative ^= factor.negative;
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

/// What the lanes of a band multiplied, in their order; the same in all of them.
__device__ BandProduct product_of(LaneProduct const& own, Lane const& lane) {
    BandProduct all;
    for (int j = 0; j < lanes; ++j) {
        double const mantissa = __shfl_sync(lane.mask, own.mantissa, j, lanes);
        auto const bits = static_cast<std::uint64_t>(__double_as_longlong(mantissa));
        BandProduct const factor{mantissa == 0 ? 0 : (bits << 11) | std::uint64_t{1} << 63,
                                 __shfl_sync(lane.mask, own.exponent, j, lanes), static_cast<std::int64_t>(bits >> 63)};
        multiply(all, factor);
    }
    return all;
}

/// What is looked for beside sums, in the voxels' own type.
template <class T> struct Looks {
    unsigned nan = 0, above = 0, below = 0;
    T low = T(HUGE_VAL), high = T(-HUGE_VAL);

    __device__ void at(T v) { // NaN is neither
        low = fmin(v, low);
        high = fmax(v, high);
    }
    __device__ void at_odd(T v) {
        nan += v != v ? 1 : 0;
        above += v == T(HUGE_VAL) ? 1 : 0;
        below += v == T(-HUGE_VAL) ? 1 : 0;
        at(v);
    }
};

/// Sums of floats; and their products, where Products: of floats of up to 32 bits, four of which double has room for
/// beside a mantissa.
template <class T, bool Products>
__global__ void __launch_bounds__(block, 8)
    float_bands(T const* in, Bands bands, FloatBand* out, BandProduct* products) {
    using Wide = std::conditional_t<std::is_same_v<T, double>, double, float>;
    Lane const lane = this_lane();
    if (lane.band >= bands.count) return;
    DeviceBand<T> const as_it_is = band_at(in, bands, lane.band), band = joined(as_it_is);
    double const shift = shift_of(as_it_is, lane);
    FloatBand result;
    Looks<Wide> looks;
    LaneSums sums;
    LaneProduct product;
    auto const add_finite = [&](double v, double& s, double& q) {
        double const d = v - shift;
        s += d;
        q += d * d;
    };
    for_lane(
        band, lane,
        [&]<int N>(T const(&voxels)[N]) {
            Wide v[N], odd = 0; // NaN, if one of them is not finite
#pragma unroll
            for (int k = 0; k < N; ++k) {
                v[k] = static_cast<Wide>(voxels[k]);
                odd = fma(v[k], Wide(0), odd);
            }
            if (odd == 0) {
#pragma unroll
                for (int k = 0; k < N; ++k) {
                    double const wide = static_cast<double>(v[k]);
                    looks.at(v[k]);
                    add_finite(wide, sums.s, sums.q);
                    if constexpr (Products) {
                        product.mantissa *= wide;
                        if (k % 4 == 3 || k == N - 1) split(product.mantissa, product.exponent);
                    }
                }
                return;
            }
            for (int k = 0; k < N; ++k) {
                looks.at_odd(v[k]);
                if (!is_finite(v[k])) continue;
                add_finite(static_cast<double>(v[k]), sums.s, sums.q);
                if constexpr (Products) {
                    product.mantissa *= static_cast<double>(v[k]);
                    split(product.mantissa, product.exponent);
                }
            }
        },
        [&](T voxel) {
            Wide const v = static_cast<Wide>(voxel);
            looks.at_odd(v);
            if (!is_finite(v)) return;
            add_finite(static_cast<double>(v), sums.tail_s, sums.tail_q);
            if constexpr (Products) {
                product.mantissa *= static_cast<double>(v);
                split(product.mantissa, product.exponent);
            }
        });
    double const low = static_cast<double>(looks.low), high = static_cast<double>(looks.high);
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
    result.nan = added(looks.nan, lane);
    result.above = added(looks.above, lane);
    result.below = added(looks.below, lane);
    result.sum = folded(sums.s + sums.tail_s, lane);
    result.squares = folded(sums.q + sums.tail_q, lane);
    result.shift = shift;
    result.low = least(low, lane);
    result.high = most(high, lane);
    if (lane.index == 0) out[lane.band] = result;
    if constexpr (Products) {
        BandProduct const all = product_of(product, lane);
        if (lane.index == 0) products[lane.band] = all;
    }
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
    for_each_of_lane(band, lane, add);
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
    BandProduct const all = product_of(product, lane);
    if (lane.index == 0) out[lane.band] = zero ? BandProduct{0, 0, 0} : all;
}

/// An array that no constructor touches, as memory shared by a block wants it.
template <class T, int N> struct Shared {
    alignas(T) unsigned char bytes[N * sizeof(T)];
    __device__ T& operator[](int i) { return reinterpret_cast<T*>(bytes)[i]; }
};

constexpr int merging = 32;
/// Counts up to and with this thread's, of a warp.
__device__ inline std::int64_t counted_up(std::int64_t count) {
    int const lane = static_cast<int>(threadIdx.x % merging);
    for (int step = 1; step < merging; step *= 2) {
        std::int64_t const before = __shfl_up_sync(~0u, count, step);
        if (lane >= step) count += before;
    }
    return count;
}

/// Bands of a slice merged in their order: the first warp has moments or integer sums, the second products, the third
/// extremes. `begun`: what the first slice goes on from, of rows before these; the others begin with nothing.
template <class Band>
__global__ void __launch_bounds__(3 * merging)
    merge_bands(Band const* bands, BandProduct const* products, std::int64_t per_slice, double origin, SliceSums begun,
                SliceSums* out) {
    std::int64_t const first = blockIdx.x * per_slice;
    SliceSums& slice = out[blockIdx.x];
    int const lane = static_cast<int>(threadIdx.x % merging), part = static_cast<int>(threadIdx.x / merging);
    constexpr bool floats = std::is_same_v<Band, FloatBand>;
    if (part == 0) {
        __shared__ Shared<FloatMoments, merging> moments;
        __shared__ Int128 sums[merging];
        __shared__ Unsigned128 squares[merging];
        __shared__ double shares[merging];
        FloatMoments all;
        if (blockIdx.x == 0) all = begun.moments;
        Int128 sum = 0;
        Unsigned128 square = 0;
        for (std::int64_t b = 0; b < per_slice; b += merging) {
            auto const count = static_cast<int>(min(static_cast<std::int64_t>(merging), per_slice - b));
            if constexpr (floats) {
                FloatMoments own;
                if (lane < count) own = moments_of(bands[first + b + lane], origin);
                moments[lane] = own;
                std::int64_t const before = __shfl_sync(~0u, all.finite, 0) + counted_up(own.finite) - own.finite;
                shares[lane] = FloatMoments::share(before, own.finite);
                __syncwarp();
                for (int j = 0; j < count && lane == 0; ++j) all.append(moments[j], shares[j]);
                __syncwarp();
            } else if (lane < count) {
                Band const& band = bands[first + b + lane];
                sum += band.sum;
                square += (static_cast<Unsigned128>(band.squares_high) << 32) + band.squares_low;
                all.finite += band.count;
            }
        }
        if constexpr (!floats) {
            sums[lane] = sum;
            squares[lane] = square;
            moments[lane].finite = all.finite;
            __syncwarp();
            for (int j = 1; j < merging && lane == 0; ++j) {
                sum += sums[j];
                square += squares[j];
                all.finite += moments[j].finite;
            }
        }
        if (lane == 0) {
            slice.moments = all;
            slice.sum = sum;
            slice.squares = square;
        }
    } else if (part == 1 && products != nullptr) {
        __shared__ Shared<BandProduct, merging> factors;
        BandProduct all;
        if (blockIdx.x == 0) all = begun.product;
        for (std::int64_t b = 0; b < per_slice; b += merging) {
            auto const count = static_cast<int>(min(static_cast<std::int64_t>(merging), per_slice - b));
            if (lane < count) factors[lane] = products[first + b + lane];
            __syncwarp();
            for (int j = 0; j < count && lane == 0; ++j) multiply(all, factors[j]);
            __syncwarp();
        }
        if (lane == 0) slice.product = all;
    } else if (part == 2) {
        using V = std::conditional_t<floats, double, std::int64_t>;
        V low = 0, high = 0;
        std::int64_t low_band = -1, high_band = -1;
        auto const look = [&](V l, std::int64_t l_band, V h, std::int64_t h_band) {
            if (l_band >= 0 && (low_band < 0 || l < low || (l == low && l_band < low_band))) {
                low = l;
                low_band = l_band;
            }
            if (h_band >= 0 && (high_band < 0 || high < h || (h == high && h_band < high_band))) {
                high = h;
                high_band = h_band;
            }
        };
        for (std::int64_t b = lane; b < per_slice; b += merging) {
            Band const& band = bands[first + b];
            bool valid = true;
            if constexpr (floats) valid = band.count > band.nan;
            look(band.low, valid ? b : -1, band.high, valid ? b : -1);
        }
        for (int half = merging / 2; half > 0; half /= 2) {
            V const l = __shfl_down_sync(~0u, low, half), h = __shfl_down_sync(~0u, high, half);
            std::int64_t const l_band = __shfl_down_sync(~0u, low_band, half),
                               h_band = __shfl_down_sync(~0u, high_band, half);
            look(l, l_band, h, h_band);
        }
        if (lane == 0) {
            if constexpr (floats) {
                slice.low = low;
                slice.high = high;
            } else {
                slice.lowest = low;
                slice.highest = high;
            }
            slice.low_band = low_band;
            slice.high_band = high_band;
        }
    }
}

/// Bands in device memory.
template <class Band> struct SummedBands {
    Buffer memory, product_memory;
    Band const* bands() { return reinterpret_cast<Band const*>(memory.read(Space::device)); }
    BandProduct const* products() {
        return product_memory.bytes() == 0 ? nullptr
                                           : reinterpret_cast<BandProduct const*>(product_memory.read(Space::device));
    }
};

template <class T> using BandOf = std::conditional_t<std::is_integral_v<T>, IntegerBand, FloatBand>;

// Kernels are launched from function templates: those that only a generic lambda instantiates are not found.
template <class T>
void sum_bands(ConstView slab, Bands const& bands, ValueMap const* product_map, SummedBands<BandOf<T>>& summed) {
    auto const* const in = reinterpret_cast<T const*>(slab.data);
    auto const count = static_cast<std::size_t>(bands.count);
    summed.memory.reserve(count * sizeof(BandOf<T>));
    auto* const out = reinterpret_cast<BandOf<T>*>(summed.memory.write(Space::device));
    BandProduct* products = nullptr;
    if (product_map != nullptr) {
        summed.product_memory.reserve(count * sizeof(BandProduct));
        products = reinterpret_cast<BandProduct*>(summed.product_memory.write(Space::device));
    }
    auto const blocks = static_cast<unsigned>((bands.count * lanes + block - 1) / block);
    bool const mapped = product_map != nullptr && !(*product_map == ValueMap{});
    bool multiplied = product_map == nullptr;
    if constexpr (!std::is_integral_v<T>) {
        if (sizeof(T) <= 4 && product_map != nullptr && !mapped) {
            float_bands<T, sizeof(T) <= 4><<<blocks, block>>>(in, bands, out, products);
            multiplied = true;
        } else {
            float_bands<T, false><<<blocks, block>>>(in, bands, out, nullptr);
        }
    } else if constexpr (sizeof(T) <= 4) {
        integer_bands<T><<<blocks, block>>>(in, bands, out);
    } else {
        wide_bands<T><<<blocks, block>>>(in, bands, out);
    }
    check_launch("statistics");
    if (multiplied) return;
    product_bands<T><<<blocks, block>>>(in, bands, mapped, product_map->slope, product_map->intercept, products);
    check_launch("products");
}

template <class T>
void bands_of(ConstView slab, Bands const& bands, MeanOrigin const& origin, ValueMap const* product_map,
              BandStatistics* to, int threads) {
    SummedBands<BandOf<T>> summed;
    sum_bands<T>(slab, bands, product_map, summed);
    finish_bands(reinterpret_cast<BandOf<T> const*>(summed.memory.read(Space::host)), bands.count, slab.type, origin,
                 to, threads);
    if (product_map != nullptr)
        finish_products(reinterpret_cast<BandProduct const*>(summed.product_memory.read(Space::host)), bands.count, to,
                        threads);
}

template <class T>
void slices_of(ConstView slab, Bands const& bands, MeanOrigin const& origin, ValueMap const* product_map,
               SliceStatistics* slices) {
    std::int64_t const count = slab.dims().z;
    SummedBands<BandOf<T>> summed;
    sum_bands<T>(slab, bands, product_map, summed);
    Buffer memory(static_cast<std::size_t>(count) * sizeof(SliceSums));
    auto* const sums = reinterpret_cast<SliceSums*>(memory.write(Space::device));
    merge_bands<BandOf<T>><<<static_cast<unsigned>(count), 3 * merging>>>(
        summed.bands(), summed.products(), bands.per_slice, origin.value, begin_slice(slices[0]), sums);
    check_launch("statistics of slices");
    auto const* const finished = reinterpret_cast<SliceSums const*>(memory.read(Space::host));
    for (std::int64_t z = 0; z < count; ++z) finish_slice(finished[z], slab.type, slices[z]);
}

Bands bands_in(ConstView slab) {
    Index3 const n = slab.dims();
    std::int64_t const per_slice = bands_in_slice(n, slab.type);
    return {n.x, rows_in_band(n, slab.type), slab.row, slab.slice, n.y, per_slice, per_slice * n.z};
}

} // namespace

void band_statistics(ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, BandStatistics* bands,
                     Execution const& execution) {
    with_type(slab.type,
              [&]<class T>(T) { bands_of<T>(slab, bands_in(slab), origin, product_map, bands, execution.threads); });
}

void slice_statistics(ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, SliceStatistics* slices,
                      Execution const&) {
    with_type(slab.type, [&]<class T>(T) {
        if constexpr (sizeof(T) <= 4) slices_of<T>(slab, bands_in(slab), origin, product_map, slices);
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
