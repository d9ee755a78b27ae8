// Bands of a slice merged on a GPU, in their order: the same sums as on CPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/statistics/kernels/device_products.h"

#include <type_traits>

namespace vkt::VKT_BACKEND::bands {

/// An array that no constructor touches, as memory shared by a block wants it.
template <class T, int N> struct Shared {
    alignas(T) unsigned char bytes[N * sizeof(T)];
    __device__ T& operator[](int i) { return reinterpret_cast<T*>(bytes)[i]; }
};

inline constexpr int merging = 32;
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

} // namespace vkt::VKT_BACKEND::bands
