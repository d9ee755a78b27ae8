// Products on a GPU, of mantissas and exponents apart: those of lanes, and bands of them in the order of CPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/statistics/kernels/device_bands.h"

#include <type_traits>

namespace vkt::VKT_BACKEND::bands {

/// Moves the exponent of a normal number, or of 0, from the one to the other.
__device__ __forceinline__ void split(double& number, std::int64_t& exponent) {
    int const high = __double2hiint(number);
    if ((high & 0x7fffffff) == 0) return;
    exponent += (high >> 20 & 0x7ff) - 1023;
    number = __hiloint2double((high & static_cast<int>(0x800fffff)) | 0x3ff00000, __double2loint(number));
}
__device__ inline void multiply(LaneProduct& product, double factor) {
    if (fabs(factor) < 0x1p-900) { // perhaps subnormal
        factor *= 0x1p200;
        product.exponent -= 200;
    }
    split(factor, product.exponent);
    product.mantissa *= factor;
    split(product.mantissa, product.exponent);
}

/// A factor a host takes as long double: rounded to 64 bits, to even.
__device__ inline void multiply(BandProduct& product, BandProduct const& factor) {
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
__device__ inline BandProduct product_of(LaneProduct const& own, Lane const& lane) {
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

inline constexpr std::int64_t product_chunk = 2048; ///< of how many voxels CPUs multiply small integers together

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

} // namespace vkt::VKT_BACKEND::bands
