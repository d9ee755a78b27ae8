// Resampling kernels: one pass over rows on the CPU, one thread per voxel on the GPU, the same sums in the same order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample_kernels.h"

#include "libvkt/operations/rows.h"
#include "libvkt/operations/wide.h"

#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// The type in which up to eight voxels are added: exactly for integers, in their own precision for floats.
template <class T>
using Sum = std::conditional_t<
    !std::is_integral_v<T>, std::conditional_t<std::is_same_v<T, double>, double, float>,
    std::conditional_t<sizeof(T) <= 2, std::int32_t, std::conditional_t<sizeof(T) == 4, std::int64_t, Int128>>>;

/// A term of the mean of 2^shift voxels: floats are divided first, so that no sum overflows.
template <class T> VKT_HD Sum<T> term_of(T v, Sum<T> share) {
    if constexpr (std::is_integral_v<T>)
        return static_cast<Sum<T>>(v);
    else
        return static_cast<Sum<T>>(v) * share;
}

/// The mean of 2^shift voxels from their terms, halves to even.
template <class T> VKT_HD T mean_of(Sum<T> sum, int shift) {
    if constexpr (std::is_integral_v<T>) {
        Sum<T> const half = (Sum<T>(1) << shift) / 2;
        return static_cast<T>(shift == 0 ? sum : (sum + half - 1 + ((sum >> shift) & 1)) >> shift);
    } else {
        return round_to<T>(sum);
    }
}

template <class T> Sum<T> share_of(int shift) {
    return std::is_integral_v<T> ? Sum<T>(1) : Sum<T>(1) / static_cast<Sum<T>>(1 << shift);
}

/// Sum of the weights of output o along an axis that stay in the volume.
VKT_HD double inside_of(AxisTable const& taps, std::int64_t o) {
    return taps.inside != nullptr ? taps.inside[o] : taps.divisor;
}

VKT_HD std::int64_t as_whole(double weight) { return static_cast<std::int64_t>(weight); }

/// A weighted sum divided by its divisor. A finite sum of float64 cannot be infinite only for being divided last.
template <class T> VKT_HD double divided(double total, double divisor) {
    double const mean = total / divisor;
    if constexpr (std::is_same_v<T, double>) {
        constexpr double most = std::numeric_limits<double>::max();
        double const kept = mean > most ? most : mean < -most ? -most : mean;
        return total - total == 0 ? kept : mean;
    }
    return mean;
}

/// sum / divisor of whole numbers, halves to even.
template <class T> VKT_HD T rounded_quotient(Int128 sum, std::int64_t divisor) {
    Int128 quotient = sum / divisor, left = sum - quotient * divisor;
    if (left < 0) {
        quotient -= 1;
        left += divisor;
    }
    left = 2 * left - divisor;
    bool const up = left > 0 || (left == 0 && (quotient & 1) != 0);
    return static_cast<T>(quotient + (up ? 1 : 0));
}

int log2_of(Index3 factors) { return static_cast<int>(factors.x + factors.y + factors.z - 3); }

#ifdef __CUDACC__

template <class U>
void nearest(View<U const> in, View<U> out, Box const& box, WeightedSum const& sum, Execution const& execution) {
    std::int64_t const *const x_of = sum.x.first, *const y_of = sum.y.first, *const z_of = sum.z.first;
    gather(execution, box, out,
           [=] VKT_DEVICE(std::int64_t x, std::int64_t y, std::int64_t z) { return in(x_of[x], y_of[y], z_of[z]); });
}

template <class T>
void halved(View<T const> in, View<T> out, Box const& box, Index3 factors, Execution const& execution) {
    int const fx = static_cast<int>(factors.x), fy = static_cast<int>(factors.y), fz = static_cast<int>(factors.z);
    int const shift = log2_of(factors);
    Sum<T> const share = share_of<T>(shift);
    gather(execution, box, out, [=] VKT_DEVICE(std::int64_t x, std::int64_t y, std::int64_t z) {
        Sum<T> pair[2] = {};
        for (int i = 0; i < fx; ++i)
            for (int k = 0; k < fz; ++k)
                for (int j = 0; j < fy; ++j) pair[i] += term_of<T>(in(x * fx + i, y * fy + j, z * fz + k), share);
        return mean_of<T>(pair[0] + pair[1], shift);
    });
}

template <class T> struct WeightedAt {
    View<T const> in;
    WeightedSum sum;
    VKT_HD double operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        double total = 0;
        std::int64_t const fx = sum.x.first[x], fy = sum.y.first[y], fz = sum.z.first[z];
        std::int64_t const x0 = sum.x.start[x], y0 = sum.y.start[y], z0 = sum.z.start[z];
        std::int64_t const nx = sum.x.start[x + 1] - x0, ny = sum.y.start[y + 1] - y0, nz = sum.z.start[z + 1] - z0;
        for (std::int64_t i = 0; i < nx; ++i) {
            double column = 0;
            for (std::int64_t k = 0; k < nz; ++k)
                for (std::int64_t j = 0; j < ny; ++j)
                    column += sum.z.weight[z0 + k] * sum.y.weight[y0 + j] * sum.unit *
                              static_cast<double>(in(fx + i, fy + j, fz + k));
            total += sum.x_identity ? column : sum.x.weight[x0 + i] * column;
        }
        if (sum.reaches_border()) {
            double const rest = sum.divisor - inside_of(sum.x, x) * (inside_of(sum.y, y) * inside_of(sum.z, z));
            if (rest != 0) total += rest * sum.unit * sum.border;
        }
        return divided<T>(total, sum.divisor * sum.unit) * sum.scale + sum.offset;
    }
};

template <class T> struct WholeAt {
    View<T const> in;
    WeightedSum sum;
    VKT_HD T operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        Int128 total = 0;
        std::int64_t const fx = sum.x.first[x], fy = sum.y.first[y], fz = sum.z.first[z];
        std::int64_t const x0 = sum.x.start[x], y0 = sum.y.start[y], z0 = sum.z.start[z];
        std::int64_t const nx = sum.x.start[x + 1] - x0, ny = sum.y.start[y + 1] - y0, nz = sum.z.start[z + 1] - z0;
        std::int64_t inside = 0;
        for (std::int64_t i = 0; i < nx; ++i)
            for (std::int64_t k = 0; k < nz; ++k)
                for (std::int64_t j = 0; j < ny; ++j) {
                    std::int64_t const weight = as_whole(sum.x.weight[x0 + i]) * as_whole(sum.y.weight[y0 + j]) *
                                                as_whole(sum.z.weight[z0 + k]);
                    inside += weight;
                    total += Int128{weight} * in(fx + i, fy + j, fz + k);
                }
        std::int64_t const divisor = as_whole(sum.x.divisor) * as_whole(sum.y.divisor) * as_whole(sum.z.divisor);
        if (inside != divisor) total += Int128{divisor - inside} * round_to<T>(sum.border);
        return rounded_quotient<T>(total, divisor);
    }
};

template <class T> void whole(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    gather(execution, out.box, out.as<T>(), WholeAt<T>{in.as<T>(), sum});
}

template <class T>
void weighted_to_double(View<T const> in, View<double> out, Box const& box, WeightedSum const& sum,
                        Execution const& execution) {
    gather(execution, box, out, WeightedAt<T>{in, sum});
}
template <class T>
void weighted_same_type(View<T const> in, View<T> out, Box const& box, WeightedSum const& sum, Tally& tally,
                        Execution const& execution) {
    gather_rounded(execution, box, out, tally, WeightedAt<T>{in, sum});
}
template <class U>
void store_doubles(View<double const> in, View<U> out, Box const& box, Tally& tally, Execution const& execution) {
    map_rounded(
        execution, box, out, tally, [=] VKT_DEVICE(double v) { return v; }, in);
}

template <class T>
void weighted(ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Tally& tally,
              Execution const& execution) {
    if (in.type == out.type) return weighted_same_type(in.as<T>(), out.as<T>(), out.box, sum, tally, execution);
    scratch.reserve(static_cast<std::size_t>(out.box.voxels()) * sizeof(double));
    AnyView const wide = dense_view(scratch.write(Space::device), DataType::float64, out.box, Space::device);
    weighted_to_double<T>(in.as<T>(), wide.as<double>(), out.box, sum, execution);
    for_each_type(out.type, [&]<class U>(U) {
        store_doubles<U>(ConstView(wide).as<double>(), out.as<U>(), out.box, tally, execution);
    });
}

#else

/// Calls f(x0, x1, y, z) for pieces of output rows, in parallel; maker() gives each thread its own f.
template <class Maker>
void for_each_piece(Execution const& execution, Box const& box, std::int64_t length, std::int64_t work,
                    Maker const& maker) {
    if (box.empty()) return;
    Index3 const n = box.dims();
    std::int64_t const pieces = (n.x + length - 1) / length;
    for_each_item(threads_for(execution, work), pieces * n.y * n.z, [&](std::int64_t begin, std::int64_t end) {
        auto f = maker();
        for (std::int64_t item = begin; item < end; ++item) {
            std::int64_t const x0 = box.lower.x + item % pieces * length;
            f(x0, std::min(x0 + length, box.upper.x), box.lower.y + item / pieces % n.y,
              box.lower.z + item / pieces / n.y);
        }
    });
}

template <class U>
void nearest(View<U const> in, View<U> out, Box const& box, WeightedSum const& sum, Execution const& execution) {
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        U const* const from = &in(0, sum.y.first[y], sum.z.first[z]);
        std::int64_t const* const index = sum.x.first + x;
        U* const to = &out(x, y, z);
        for (std::int64_t i = 0; i < n; ++i) to[i] = from[index[i]];
    });
}

/// to[i] = sum of the rows' voxels i.
template <class T, int N> void add_rows(T const* const (&rows)[4], Sum<T>* to, std::int64_t n, Sum<T> share) {
    T const *const a = rows[0], *const b = rows[1], *const c = rows[2], *const d = rows[3];
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        Sum<T> s = term_of<T>(a[i], share);
        if constexpr (N > 1) s += term_of<T>(b[i], share);
        if constexpr (N > 2) s = (s + term_of<T>(c[i], share)) + term_of<T>(d[i], share);
        to[i] = s;
    }
}

template <class T> void halve_columns(Sum<T> const* sums, T* to, std::int64_t n, bool pairs, int shift) {
    if (pairs) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = mean_of<T>(sums[2 * i] + sums[2 * i + 1], shift);
    } else {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = mean_of<T>(sums[i], shift);
    }
}

template <class T>
void halved(View<T const> in, View<T> out, Box const& box, Index3 factors, Execution const& execution) {
    int const shift = log2_of(factors);
    Sum<T> const share = share_of<T>(shift);
    for_each_piece(execution, box, row_piece / 2, box.voxels() << shift, [&] {
        return [&, sums = std::vector<Sum<T>>(row_piece)](std::int64_t x0, std::int64_t x1, std::int64_t y,
                                                          std::int64_t z) mutable {
            std::int64_t const n = (x1 - x0) * factors.x;
            T const* rows[4] = {};
            int count = 0;
            for (std::int64_t k = 0; k < factors.z; ++k)
                for (std::int64_t j = 0; j < factors.y; ++j)
                    rows[count++] = &in(x0 * factors.x, y * factors.y + j, z * factors.z + k);
            if (count == 1) add_rows<T, 1>(rows, sums.data(), n, share);
            if (count == 2) add_rows<T, 2>(rows, sums.data(), n, share);
            if (count == 4) add_rows<T, 4>(rows, sums.data(), n, share);
            halve_columns<T>(sums.data(), &out(x0, y, z), x1 - x0, factors.x == 2, shift);
        };
    });
}

/// to[i] (+)= sum over four rows of weight * voxel, added one after the other.
template <bool First, class T>
void add_weighted4(T const* const* rows, double const* weights, double* to, std::int64_t n) {
    T const *const a = rows[0], *const b = rows[1], *const c = rows[2], *const d = rows[3];
    double const wa = weights[0], wb = weights[1], wc = weights[2], wd = weights[3];
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        double s = wa * static_cast<double>(a[i]);
        if constexpr (!First) s = to[i] + s;
        s += wb * static_cast<double>(b[i]);
        s += wc * static_cast<double>(c[i]);
        to[i] = s + wd * static_cast<double>(d[i]);
    }
}
template <bool First, class T> void add_weighted(T const* row, double weight, double* to, std::int64_t n) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        double const s = weight * static_cast<double>(row[i]);
        to[i] = First ? s : to[i] + s;
    }
}

/// The weighted sum of all rows in the footprint of output row (y, z), for input columns [lower, lower + n).
template <class T>
void sum_rows(View<T const> in, WeightedSum const& sum, std::int64_t y, std::int64_t z, std::int64_t lower,
              std::int64_t n, double* to) {
    std::int64_t const ny = sum.y.start[y + 1] - sum.y.start[y], nz = sum.z.start[z + 1] - sum.z.start[z];
    double const *const wy = sum.y.weight + sum.y.start[y], *const wz = sum.z.weight + sum.z.start[z];
    T const* rows[4];
    double weights[4];
    int pending = 0;
    bool first = true;
    for (std::int64_t k = 0; k < nz; ++k)
        for (std::int64_t j = 0; j < ny; ++j) {
            rows[pending] = &in(lower, sum.y.first[y] + j, sum.z.first[z] + k);
            weights[pending++] = wz[k] * wy[j] * sum.unit;
            if (pending < 4) continue;
            first ? add_weighted4<true>(rows, weights, to, n) : add_weighted4<false>(rows, weights, to, n);
            first = false;
            pending = 0;
        }
    for (int i = 0; i < pending; ++i) {
        first ? add_weighted<true>(rows[i], weights[i], to, n) : add_weighted<false>(rows[i], weights[i], to, n);
        first = false;
    }
}

/// Weighted sums along x. columns[i] belongs to input column lower + i.
void sum_columns(AxisTable const& x, std::int64_t x0, std::int64_t x1, double const* columns, std::int64_t lower,
                 double* to) {
    if (x.pair != nullptr) { // a zero weight must not touch its neighbour: 0 * infinity is NaN
        double const* const pairs = x.pair + 2 * x0;
        std::int64_t const* const first = x.first + x0;
        std::int64_t const n = x1 - x0;
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) {
            double const* const c = columns + (first[i] - lower);
            double const a = pairs[2 * i] * c[0], b = pairs[2 * i + 1];
            to[i] = b == 0 ? a : a + b * c[1];
        }
        return;
    }
    for (std::int64_t o = x0; o < x1; ++o) {
        double const* const c = columns + (x.first[o] - lower);
        double const* const w = x.weight + x.start[o];
        std::int64_t const n = x.start[o + 1] - x.start[o];
        double total = w[0] * c[0];
        for (std::int64_t i = 1; i < n; ++i) total += w[i] * c[i];
        to[o - x0] = total;
    }
}

/// Adds what the weights of output row (y, z) that fall outside take from the border.
void add_border(WeightedSum const& sum, std::int64_t x0, std::int64_t n, std::int64_t y, std::int64_t z,
                double* values) {
    double const rows = inside_of(sum.y, y) * inside_of(sum.z, z);
    for (std::int64_t i = 0; i < n; ++i) {
        double const rest = sum.divisor - inside_of(sum.x, x0 + i) * rows;
        if (rest != 0) values[i] += rest * sum.unit * sum.border;
    }
}

template <class T> void scale_row(double* values, std::int64_t n, double divisor, double scale, double offset) {
    if (divisor != 1) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) values[i] = divided<T>(values[i], divisor);
    }
    if (scale != 1 || offset != 0) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) values[i] = values[i] * scale + offset;
    }
}

template <class T>
void weighted(ConstView from, AnyView out, WeightedSum const& sum, Buffer&, Tally& tally, Execution const& execution) {
    View<T const> const in = from.as<T>();
    Box const box = out.box;
    std::int64_t const length = summed_together(from.dims().x, box.dims().x);
    for_each_piece(execution, box, length, std::max(from.box.voxels(), box.voxels()), [&] {
        return [&, columns = std::vector<double>(), row = std::vector<double>(static_cast<std::size_t>(length))](
                   std::int64_t x0, std::int64_t x1, std::int64_t y, std::int64_t z) mutable {
            std::int64_t lower = sum.x.first[x0], upper = lower + 1;
            for (std::int64_t o = x0; o < x1; ++o) {
                lower = std::min(lower, sum.x.first[o]);
                upper = std::max(upper, sum.x.first[o] + sum.x.start[o + 1] - sum.x.start[o]);
            }
            columns.resize(static_cast<std::size_t>(upper - lower + 1)); // pairs read one beyond, with weight 0
            sum_rows(in, sum, y, z, lower, upper - lower, columns.data());
            double* values = columns.data();
            if (!sum.x_identity) {
                sum_columns(sum.x, x0, x1, columns.data(), lower, row.data());
                values = row.data();
            }
            std::int64_t const n = x1 - x0;
            if (sum.reaches_border()) add_border(sum, x0, n, y, z, values);
            scale_row<T>(values, n, sum.divisor * sum.unit, sum.scale, sum.offset);
            driver::add(tally, store_row(out.type, static_cast<double const*>(values), out.at(x0, y, z), n));
        };
    });
}

/// The same in whole numbers: sums of 64-bit integers have more digits than a double.
template <class T> void whole(ConstView from, AnyView to, WeightedSum const& sum, Execution const& execution) {
    View<T const> const in = from.as<T>();
    View<T> const out = to.as<T>();
    std::int64_t const divisor = as_whole(sum.x.divisor) * as_whole(sum.y.divisor) * as_whole(sum.z.divisor);
    Int128 const border = round_to<T>(sum.border);
    std::int64_t const length = summed_together(from.dims().x, to.dims().x);
    for_each_piece(execution, to.box, length, std::max(from.box.voxels(), to.box.voxels()), [&] {
        return [&, columns = std::vector<Int128>()](std::int64_t x0, std::int64_t x1, std::int64_t y,
                                                    std::int64_t z) mutable {
            std::int64_t lower = sum.x.first[x0], upper = lower + 1;
            for (std::int64_t o = x0; o < x1; ++o) {
                lower = std::min(lower, sum.x.first[o]);
                upper = std::max(upper, sum.x.first[o] + sum.x.start[o + 1] - sum.x.start[o]);
            }
            columns.assign(static_cast<std::size_t>(upper - lower), 0);
            for (std::int64_t k = sum.z.start[z]; k < sum.z.start[z + 1]; ++k)
                for (std::int64_t j = sum.y.start[y]; j < sum.y.start[y + 1]; ++j) {
                    std::int64_t const weight = as_whole(sum.z.weight[k]) * as_whole(sum.y.weight[j]);
                    T const* const row =
                        &in(lower, sum.y.first[y] + j - sum.y.start[y], sum.z.first[z] + k - sum.z.start[z]);
                    for (std::size_t i = 0; i < columns.size(); ++i) columns[i] += Int128{weight} * row[i];
                }
            std::int64_t const rows = as_whole(inside_of(sum.y, y)) * as_whole(inside_of(sum.z, z));
            T* const row = &out(x0, y, z);
            for (std::int64_t o = x0; o < x1; ++o) {
                Int128 const* const c = columns.data() + (sum.x.first[o] - lower);
                double const* const w = sum.x.weight + sum.x.start[o];
                Int128 total = 0;
                for (std::int64_t i = 0; i < sum.x.start[o + 1] - sum.x.start[o]; ++i) total += as_whole(w[i]) * c[i];
                std::int64_t const rest = divisor - as_whole(inside_of(sum.x, o)) * rows;
                row[o - x0] = rounded_quotient<T>(total + rest * border, divisor);
            }
        };
    });
}

#endif

} // namespace

void resample_nearest(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    for_each_size(size_of(in.type), [&]<class U>(U) { nearest<U>(in.as<U>(), out.as<U>(), out.box, sum, execution); });
}

void resample_halved(ConstView in, AnyView out, Index3 factors, Execution const& execution) {
    for_each_type(in.type, [&]<class T>(T) { halved<T>(in.as<T>(), out.as<T>(), out.box, factors, execution); });
}

void resample_whole(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    if (in.type == DataType::int64) return whole<std::int64_t>(in, out, sum, execution);
    whole<std::uint64_t>(in, out, sum, execution);
}

void resample_weighted(ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Tally& tally,
                       Execution const& execution) {
    for_each_type(in.type, [&]<class T>(T) { weighted<T>(in, out, sum, scratch, tally, execution); });
}

} // namespace VKT_BACKEND

} // namespace vkt
