// Resampling kernels: one pass over rows on the CPU, one thread per voxel on the GPU, the same sums in the same order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/resample.h"
#include "libvkt/operations/resample/kernels/resample_sums.h"

#include "libvkt/core/wide.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"

#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Calls f(x0, x1, y, z) for pieces of output rows, in parallel; maker() gives each thread its own f.
template <class Maker>
void for_each_piece(Execution const& execution, Box const& box, std::int64_t length, std::int64_t work,
                    Maker const& maker) {
    if (box.empty()) return;
    Index3 const n = box.dims();
    std::int64_t const pieces = (n.x + length - 1) / length;
    for_each_item(execution, threads_for(execution, work), pieces * n.y * n.z,
                  [&](std::int64_t begin, std::int64_t end) {
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

} // namespace

void resample_nearest(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    for_each_size(size_of(in.type), [&]<class U>(U) { nearest<U>(in.as<U>(), out.as<U>(), out.box, sum, execution); });
}

void resample_halved(ConstView in, AnyView out, Index3 factors, Execution const& execution) {
    with_type(in.type, [&]<class T>(T) { halved<T>(in.as<T>(), out.as<T>(), out.box, factors, execution); });
}

void resample_whole(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    if (in.type == DataType::int64) return whole<std::int64_t>(in, out, sum, execution);
    whole<std::uint64_t>(in, out, sum, execution);
}

} // namespace VKT_BACKEND

} // namespace vkt
