// Statistics of bands of rows on GPUs: 16 threads a band, one for each of the lanes in which CPUs sum.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/statistics.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/device_slices.h"

#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

using namespace bands;

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
