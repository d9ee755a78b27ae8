// Finishing bands of statistics, on the host for every back end.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/statistics_bands.h"

#include "libvkt/kernel/numeric.h"

#include <algorithm>

namespace vkt {

void finish_band(FloatBand const& band, bool doubles, double origin, BandStatistics& out) {
    out.range = {};
    out.range.valid = band.count > band.nan;
    out.range.low = band.low;
    out.range.high = band.high;
    if (!doubles) {
        out.narrow = moments_of(band, origin);
        return;
    }
    Moments& m = out.moments;
    m = {};
    m.nan = band.nan;
    m.positive_infinity = band.above;
    m.negative_infinity = band.below;
    m.finite = band.count - band.nan - band.above - band.below;
    if (m.finite > 0) {
        auto const n = static_cast<double>(m.finite);
        double const shift = band.shift * band.scale;
        double const product = n * shift;
        double const sum = product + band.sum, back = sum - product;
        double const error = (product - (sum - back)) + (band.sum - back) + __builtin_fma(n, shift, -product);
        double const deviations = band.squares - band.sum * band.sum / n;
        bool const kept = !(deviations <= 0); // NaN, too
        m.deviations = kept ? deviations : 0;
        long double const unscaled = 1 / static_cast<long double>(band.scale);
        m.sum = sum * unscaled;
        m.sum_error = error * unscaled;
        m.deviations *= unscaled * unscaled;
        m.mean = (band.shift - static_cast<long double>(origin)) + band.sum / n * unscaled;
    }
}

namespace {

template <class T> void finish_band(IntegerBand const& band, Int128 origin, BandStatistics& out) {
    Moments& m = out.moments;
    m = {};
    m.finite = band.count;
    m.integer_sum = band.sum;
    if constexpr (sizeof(T) <= 4) {
        m.squares = (static_cast<Unsigned128>(band.squares_high) << 32) + band.squares_low;
    } else {
        auto const count = static_cast<double>(band.count);
        m.mean = static_cast<double>(static_cast<Int128>(static_cast<T>(band.first)) - origin) + band.s / count;
        m.deviations = std::max(0.0, band.q - band.s * band.s / count);
    }
    T const low = static_cast<T>(band.low), high = static_cast<T>(band.high);
    out.range = {true, static_cast<double>(low), static_cast<double>(high), low, high};
}

Product product_of(BandProduct const& p) {
    long double const size = static_cast<long double>(p.mantissa) * 0x1p-63L;
    return {p.negative != 0 ? -size : size, p.exponent};
}

} // namespace

void finish_bands(FloatBand const* bands, std::int64_t count, DataType type, MeanOrigin const& origin,
                  BandStatistics* out, int threads) {
#pragma omp parallel for num_threads(threads) if (threads > 1)
    for (std::int64_t b = 0; b < count; ++b) {
        finish_band(bands[b], type == DataType::float64, origin.value, out[b]);
        out[b].product = Product{};
    }
}

void finish_bands(IntegerBand const* bands, std::int64_t count, DataType type, MeanOrigin const& origin,
                  BandStatistics* out, int threads) {
    with_type(type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T>) {
#pragma omp parallel for num_threads(threads) if (threads > 1)
            for (std::int64_t b = 0; b < count; ++b) {
                finish_band<T>(bands[b], origin.integer, out[b]);
                out[b].product = Product{};
            }
        }
    });
}

SliceSums begin_slice(SliceStatistics const& slice) {
    SliceSums sums;
    sums.moments = slice.narrow;
    long double const size = slice.product.mantissa < 0 ? -slice.product.mantissa : slice.product.mantissa;
    sums.product = {static_cast<std::uint64_t>(size * 0x1p63L), slice.product.exponent,
                    slice.product.mantissa < 0 ? 1 : 0};
    return sums;
}

void finish_slice(SliceSums const& sums, DataType type, SliceStatistics& out) {
    out.product = product_of(sums.product);
    out.range = {};
    out.range.valid = sums.low_band >= 0;
    out.low_band = sums.low_band;
    out.high_band = sums.high_band;
    if (!is_integer(type)) {
        out.narrow = sums.moments;
        out.range.low = sums.low;
        out.range.high = sums.high;
        return;
    }
    Moments more;
    more.finite = sums.moments.finite;
    more.integer_sum = sums.sum;
    more.squares = sums.squares;
    out.moments.append(more, true);
    out.range = {out.range.valid, static_cast<double>(sums.lowest), static_cast<double>(sums.highest), sums.lowest,
                 sums.highest};
}

void finish_products(BandProduct const* products, std::int64_t count, BandStatistics* out, int threads) {
#pragma omp parallel for num_threads(threads) if (threads > 1)
    for (std::int64_t b = 0; b < count; ++b) {
        out[b].product = product_of(products[b]);
    }
}

} // namespace vkt
