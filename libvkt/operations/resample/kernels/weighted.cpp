// Weighted sums on CPUs, a tile of a slice of the result at a time: of rows, in one go or of slices first, and then of
// columns of many of these rows side by side.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/resample.h"
#include "libvkt/operations/resample/kernels/resample_sums.h"

#include "libvkt/kernel/cpu_tiles.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"

#include <algorithm>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

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

/// The sum of rows of n values, added one after the other, four at a time.
template <class T> class RowSum {
public:
    RowSum(double* to, std::int64_t n) : to_(to), n_(n) {}
    void add(T const* row, double weight) {
        rows_[pending_] = row;
        weights_[pending_++] = weight;
        if (pending_ < 4) return;
        first_ ? add_weighted4<true>(rows_, weights_, to_, n_) : add_weighted4<false>(rows_, weights_, to_, n_);
        first_ = false;
        pending_ = 0;
    }
    void finish() {
        for (int i = 0; i < pending_; ++i) {
            first_ ? add_weighted<true>(rows_[i], weights_[i], to_, n_)
                   : add_weighted<false>(rows_[i], weights_[i], to_, n_);
            first_ = false;
        }
    }

private:
    double* to_;
    std::int64_t n_;
    T const* rows_[4] = {};
    double weights_[4] = {};
    int pending_ = 0;
    bool first_ = true;
};

/// Adds what the weights of output row (y, z) that fall outside take from the border.
void add_border(WeightedSum const& sum, std::int64_t x0, std::int64_t n, std::int64_t y, std::int64_t z,
                double* values) {
    double const rows = inside_of(sum.y, y) * inside_of(sum.z, z);
    for (std::int64_t i = 0; i < n; ++i) {
        double const rest = sum.divisor - inside_of(sum.x, x0 + i) * rows;
        if (rest != 0) values[i] += rest * sum.unit * sum.border;
    }
}

template <class T> void divide_row(double* values, std::int64_t n, double divisor) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) values[i] = divided<T>(values[i], divisor);
}

void scale_row(DataType type, double* values, std::int64_t n, double divisor, double scale, double offset) {
    if (divisor != 1 && type == DataType::float64) divide_row<double>(values, n, divisor);
    if (divisor != 1 && type != DataType::float64) divide_row<float>(values, n, divisor);
    if (scale != 1 || offset != 0) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) values[i] = values[i] * scale + offset;
    }
}

struct Range {
    std::int64_t lower, upper;
    std::int64_t size() const { return upper - lower; }
};

/// What outputs [begin, end) look at.
Range range_of(AxisTable const& table, std::int64_t begin, std::int64_t end) {
    Range range{table.first[begin], table.first[begin] + 1};
    for (std::int64_t o = begin; o < end; ++o) {
        range.lower = std::min(range.lower, table.first[o]);
        range.upper = std::max(range.upper, table.first[o] + table.start[o + 1] - table.start[o]);
    }
    return range;
}

/// What a thread works with.
struct Sums {
    std::vector<double> slice; ///< in passes: the rows of a tile's footprint
    std::vector<double> row;
    std::vector<double> columns, values; ///< along y, and then along x: rows side by side
};

template <class T>
void sum_slices(View<T const> in, WeightedSum const& sum, Range x, Range y, std::int64_t z, double* to) {
    std::int64_t const begin = sum.z.start[z], n = sum.z.start[z + 1] - begin;
    for (std::int64_t j = y.lower; j < y.upper; ++j) {
        RowSum<T> rows(to + (j - y.lower) * x.size(), x.size());
        for (std::int64_t k = 0; k < n; ++k)
            rows.add(&in(x.lower, j, sum.z.first[z] + k), sum.z.weight[begin + k] * sum.unit);
        rows.finish();
    }
}

/// Row y of the result before it is summed along x.
template <class T>
void sum_rows(View<T const> in, WeightedSum const& sum, Range x, std::int64_t y, std::int64_t z, double* to) {
    std::int64_t const ny = sum.y.start[y + 1] - sum.y.start[y], nz = sum.z.start[z + 1] - sum.z.start[z];
    double const *const wy = sum.y.weight + sum.y.start[y], *const wz = sum.z.weight + sum.z.start[z];
    RowSum<T> rows(to, x.size());
    for (std::int64_t k = 0; k < nz; ++k)
        for (std::int64_t j = 0; j < ny; ++j)
            rows.add(&in(x.lower, sum.y.first[y] + j, sum.z.first[z] + k), wz[k] * wy[j] * sum.unit);
    rows.finish();
}

/// The same of slices that are summed already.
void sum_rows(double const* slice, WeightedSum const& sum, Range x, Range y_range, std::int64_t y, double* to) {
    std::int64_t const begin = sum.y.start[y], n = sum.y.start[y + 1] - begin;
    RowSum<double> rows(to, x.size());
    for (std::int64_t k = 0; k < n; ++k)
        rows.add(slice + (sum.y.first[y] - y_range.lower + k) * x.size(), sum.y.weight[begin + k]);
    rows.finish();
}

/// Of all lanes; those that were not filled hold anything.
template <std::int64_t lanes>
void sum_columns(AxisTable const& x, Range outputs, std::int64_t lower, double const* columns, double* to) {
    for (std::int64_t o = outputs.lower; o < outputs.upper; ++o) {
        double const* column = columns + (x.first[o] - lower) * lanes;
        double total[lanes];
        double const first = x.weight[x.start[o]];
#pragma omp simd
        for (std::int64_t i = 0; i < lanes; ++i) total[i] = first * column[i];
        for (std::int64_t k = x.start[o] + 1; k < x.start[o + 1]; ++k) {
            column += lanes;
            double const weight = x.weight[k];
#pragma omp simd
            for (std::int64_t i = 0; i < lanes; ++i) total[i] += weight * column[i];
        }
        std::copy_n(total, lanes, to + (o - outputs.lower) * lanes);
    }
}

template <std::int64_t lanes>
Losses make_tile(ConstView in, AnyView out, WeightedSum const& sum, Range x, Range y, std::int64_t z, Sums& sums) {
    Range const columns = range_of(sum.x, x.lower, x.upper), rows = range_of(sum.y, y.lower, y.upper);
    sums.row.resize(static_cast<std::size_t>(std::max(columns.size(), x.size())));
    sums.columns.resize(static_cast<std::size_t>(columns.size() * lanes));
    sums.values.resize(static_cast<std::size_t>(x.size() * lanes));
    double* const row = sums.row.data();
    if (sum.in_passes) {
        sums.slice.resize(static_cast<std::size_t>(columns.size() * rows.size()));
        with_type(in.type, [&]<class T>(T) { sum_slices(in.as<T>(), sum, columns, rows, z, sums.slice.data()); });
    }
    Losses losses;
    auto const make_row = [&](std::int64_t at) {
        if (sum.in_passes) return sum_rows(sums.slice.data(), sum, columns, rows, at, row);
        with_type(in.type, [&]<class T>(T) { sum_rows(in.as<T>(), sum, columns, at, z, row); });
    };
    auto const store = [&](std::int64_t at) {
        if (sum.reaches_border()) add_border(sum, x.lower, x.size(), at, z, row);
        scale_row(in.type, row, x.size(), sum.divisor * sum.unit, sum.scale, sum.offset);
        driver::add(losses, store_row(out.type, static_cast<double const*>(row), out.at(x.lower, at, z), x.size()));
    };
    for (std::int64_t first = y.lower; first < y.upper; first += lanes) {
        std::int64_t const n = std::min(lanes, y.upper - first);
        for (std::int64_t lane = 0; lane < n; ++lane) {
            make_row(first + lane);
            if (sum.x_identity) {
                store(first + lane);
                continue;
            }
            double* const beside = sums.columns.data() + lane;
            for (std::int64_t i = 0; i < columns.size(); ++i) beside[i * lanes] = row[i];
        }
        if (sum.x_identity) continue;
        sum_columns<lanes>(sum.x, x, columns.lower, sums.columns.data(), sums.values.data());
        for (std::int64_t lane = 0; lane < n; ++lane) {
            double const* const beside = sums.values.data() + lane;
            for (std::int64_t i = 0; i < x.size(); ++i) row[i] = beside[i * lanes];
            store(first + lane);
        }
    }
    return losses;
}

} // namespace

void resample_weighted(ConstView in, AnyView out, WeightedSum const& sum, Buffer&, Losses& losses,
                       Execution const& execution) {
    Index3 const extent{sum.tile.x, sum.tile.y, 1};
    auto const make = sum.tile.lanes == 1 ? make_tile<1> : make_tile<SumTile::most_lanes>;
    std::int64_t const work = std::max(in.box.voxels(), out.box.voxels());
    for_each_tile(execution, threads_for(execution, work), out.box, extent, [&](auto const& each) {
        Sums sums;
        Losses own;
        each([&](Box const& tile) {
            Range const columns{tile.lower.x, tile.upper.x}, rows{tile.lower.y, tile.upper.y};
            driver::add(own, make(in, out, sum, columns, rows, tile.lower.z, sums));
        });
        driver::add(losses, own);
    });
}

} // namespace vkt::VKT_BACKEND
