// CLAHE: curves are blended along z once a slice and along y once a row where that is cheaper than for every voxel; the
// order of the blends is always the same.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/clahe.h"

#include <type_traits>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// The two bricks between whose centres a voxel lies along an axis, and how far it is from the first.
struct Between {
    std::int32_t first, second;
    double weight;
};

/// Along one axis: (i + 1/2) / length of a brick - 1/2, from the first brick's centre to the last one's.
struct AxisBlend {
    double lower, bricks, voxels;

    AxisBlend(BrickGrid const& grid, int axis)
        : lower(static_cast<double>(grid.box.lower[axis])), bricks(static_cast<double>(grid.bricks[axis])),
          voxels(static_cast<double>(grid.box.dims()[axis])) {}

    VKT_HD Between at(double i) const {
        double position = (i - lower + 0.5) * bricks / voxels - 0.5;
        position = position > 0 ? position : 0;
        position = position < bricks - 1 ? position : bricks - 1;
        auto const first = static_cast<std::int32_t>(position);
        auto const last = static_cast<std::int32_t>(bricks) - 1;
        return {first, first < last ? first + 1 : last, position - static_cast<double>(first)};
    }
};

template <class C> VKT_HD C blend(C a, C b, C weight) { return a + weight * (b - a); }

/// Where a voxel's value lies among the bins.
template <class C> struct Place {
    std::int32_t bin;
    C rest;
};

/// From values to bins, and from shares to values. C is float or double.
template <class C> struct Window {
    std::int32_t bins;
    C low, high, scale, unscale, scaled_low, scaled_width, per_unit;

    explicit Window(ClaheField const& f)
        : bins(f.bins), low(static_cast<C>(f.low)), high(static_cast<C>(f.high)), scale(static_cast<C>(f.scale)),
          unscale(static_cast<C>(1 / f.scale)), scaled_low(static_cast<C>(f.scaled_low)),
          scaled_width(static_cast<C>(f.scaled_width)), per_unit(static_cast<C>(f.per_unit)) {}

    VKT_HD Place<C> place(C v) const {
        C at = (v * scale - scaled_low) * per_unit;
        at = at > C(0) ? at : C(0); // NaN becomes 0
        C const last = static_cast<C>(bins - 1);
        auto const bin = static_cast<std::int32_t>(at < last ? at : last);
        C const rest = at - static_cast<C>(bin);
        return {bin, rest < C(1) ? rest : C(1)};
    }
    VKT_HD C value(C share, C v) const {
        C result = (scaled_low + share * scaled_width) * unscale;
        result = result > low ? result : low;
        result = result < high ? result : high;
        return v == v ? result : v;
    }
    VKT_HD bool outside(C v) const { return v < low || v > high; }
};

/// 64-bit integers count from the base, as doubles.
VKT_HD double distance(Int128 v, Int128 base) { return static_cast<double>(v - base); }
VKT_HD Int128 from_distance(double d, Int128 base) { return base + static_cast<Int128>(__builtin_rint(d)); }

#ifdef __CUDACC__

/// A voxel on its own. V is what it is given as.
template <class V, class C> struct Equalize {
    Window<C> window;
    AxisBlend x, y, z;
    C const* curves;
    std::int32_t across, down; ///< bricks along x and y
    Int128 base;

    VKT_HD C share(double px, double py, double pz, C v) const {
        Place<C> const p = window.place(v);
        Between const bx = x.at(px), by = y.at(py), bz = z.at(pz);
        std::int64_t const points = window.bins + 1;
        auto const corner = [&](std::int32_t i, std::int32_t j, std::int32_t k) {
            return curves + ((static_cast<std::int64_t>(k) * down + j) * across + i) * points + p.bin;
        };
        auto const column = [&](std::int32_t i) {
            C ends[2];
            for (int e = 0; e < 2; ++e)
                ends[e] = blend(blend(corner(i, by.first, bz.first)[e], corner(i, by.first, bz.second)[e],
                                      static_cast<C>(bz.weight)),
                                blend(corner(i, by.second, bz.first)[e], corner(i, by.second, bz.second)[e],
                                      static_cast<C>(bz.weight)),
                                static_cast<C>(by.weight));
            return blend(ends[0], ends[1], p.rest);
        };
        return blend(column(bx.first), column(bx.second), static_cast<C>(bx.weight));
    }
    VKT_HD C own(V v) const {
        if constexpr (std::is_same_v<V, Int128>)
            return distance(v, base);
        else
            return v;
    }
    VKT_HD V operator()(double px, double py, double pz, V v) const {
        C const c = own(v), result = window.value(share(px, py, pz, c), c);
        if constexpr (std::is_same_v<V, Int128>)
            return from_distance(result, base);
        else
            return result;
    }
    VKT_HD bool undefined(V v) const { return window.outside(own(v)); }
};

template <class V, class C>
void map_all(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
             Execution const& execution) {
    BrickGrid const& grid = field.grid;
    Equalize<V, C> const equalize{Window<C>(field),
                                  AxisBlend(grid, 0),
                                  AxisBlend(grid, 1),
                                  AxisBlend(grid, 2),
                                  reinterpret_cast<C const*>(curves.read(execution.space())),
                                  static_cast<std::int32_t>(grid.bricks.x),
                                  static_cast<std::int32_t>(grid.bricks.y),
                                  field.base};
    map_at<V>(execution, out, losses, equalize, in);
}

#else

/// The curves that rows of one slice are mapped by, blended along z.
template <class C> class SliceCurves {
public:
    SliceCurves(ClaheField const& field, C const* all)
        : all_(all), brick_(field.bins + 1), slice_(brick_ * field.grid.bricks.x * field.grid.bricks.y) {}

    /// For bricks [first, end) along y of a grid `across` wide.
    void blend_at(Between z, std::int64_t begin, std::int64_t end) {
        C const *const a = all_ + z.first * slice_, *const b = all_ + z.second * slice_;
        if (z.first == z.second || z.weight == 0) {
            curves_ = a;
            return;
        }
        if (blended_.empty()) blended_.resize(static_cast<std::size_t>(slice_));
        C* const to = blended_.data();
        C const w = static_cast<C>(z.weight);
#pragma omp simd
        for (std::int64_t i = begin; i < end; ++i) to[i] = blend(a[i], b[i], w);
        curves_ = to;
    }
    C const* curves() const { return curves_; }

private:
    C const* all_;
    std::int64_t brick_, slice_;
    std::vector<C> blended_;
    C const* curves_ = nullptr;
};

/// Columns of bricks and weights along x.
template <class C> struct Columns {
    std::vector<std::int32_t> first, second; ///< where their curves begin in a row of curves
    std::vector<C> weight;

    Columns(ClaheField const& field, Box const& box) {
        AxisBlend const x(field.grid, 0);
        for (std::int64_t i = box.lower.x; i < box.upper.x; ++i) {
            Between const b = x.at(static_cast<double>(i));
            first.push_back(b.first * (field.bins + 1));
            second.push_back(b.second * (field.bins + 1));
            weight.push_back(static_cast<C>(b.weight));
        }
    }
};

/// Shares of a piece of a row from curves that are blended along y and z.
template <class C>
void map_blended(Window<C> const window, C const* row, std::int32_t const* first, std::int32_t const* second,
                 C const* weight, C const* values, C* results, std::int64_t n) {
#pragma omp simd
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
        C const v = values[i];
        Place<C> const p = window.place(v);
        std::int32_t const a = first[i] + p.bin, b = second[i] + p.bin;
        C const left = blend(row[a], row[a + 1], p.rest), right = blend(row[b], row[b + 1], p.rest);
        results[i] = window.value(blend(left, right, weight[i]), v);
    }
}

/// The same from curves blended along z only: `upper` is the row of bricks after `row`.
template <class C>
void map_between(Window<C> const window, C const* row, C const* upper, C const y, std::int32_t const* first,
                 std::int32_t const* second, C const* weight, C const* values, C* results, std::int64_t n) {
#pragma omp simd
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
        C const v = values[i];
        Place<C> const p = window.place(v);
        std::int32_t const a = first[i] + p.bin, b = second[i] + p.bin;
        C const left = blend(blend(row[a], upper[a], y), blend(row[a + 1], upper[a + 1], y), p.rest),
                right = blend(blend(row[b], upper[b], y), blend(row[b + 1], upper[b + 1], y), p.rest);
        results[i] = window.value(blend(left, right, weight[i]), v);
    }
}

template <class C> std::int64_t count_outside(Window<C> const window, C const* values, std::int64_t n) {
    std::int32_t count = 0;
#pragma omp simd reduction(+ : count)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) count += window.outside(values[i]) ? 1 : 0;
    return count;
}

template <class V, class C> class RowMapper {
public:
    RowMapper(ConstView in, AnyView out, ClaheField const& field, Columns<C> const& columns)
        : in_(in), out_(out), field_(field), columns_(columns), window_(field), y_(field.grid, 1),
          points_((field.bins + 1) * field.grid.bricks.x), blends_(points_ <= 16 * out.dims().x),
          row_(blends_ ? static_cast<std::size_t>(points_) : 0) {}

    void map(std::int64_t y, std::int64_t z, C const* curves) {
        Between const b = y_.at(static_cast<double>(y));
        C const *lower = curves + b.first * points_, *const upper = curves + b.second * points_;
        auto const weight = static_cast<C>(b.weight);
        if (blends_) {
            C* const to = row_.data();
#pragma omp simd
            for (std::int64_t i = 0; i < points_; ++i) to[i] = blend(lower[i], upper[i], weight);
            lower = to;
        }
        Box const box = out_.box;
        for (std::int64_t x = 0; x < box.dims().x; x += row_piece) {
            std::int64_t const n = std::min(row_piece, box.dims().x - x);
            alignas(64) C buffer[row_piece];
            C const* const values = load(box.lower.x + x, y, z, n, buffer);
            std::int32_t const *const first = columns_.first.data() + x, *const second = columns_.second.data() + x;
            C const* const across = columns_.weight.data() + x;
            losses_.clipped += count_outside(window_, values, n);
            std::byte* const to = out_.at(box.lower.x + x, y, z);
            driver::RowResult<C> result(out_, to, driver::is_large(out_));
            C* const shares = std::is_same_v<V, Int128> ? buffer : result.data();
            if (blends_)
                map_blended(window_, lower, first, second, across, values, shares, n);
            else
                map_between(window_, lower, upper, weight, first, second, across, values, shares, n);
            if constexpr (std::is_same_v<V, Int128>)
                store_whole(buffer, to, n);
            else
                result.store(n);
        }
    }
    Losses const& losses() const { return losses_; }

private:
    C const* load(std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, C* buffer) {
        if constexpr (std::is_same_v<V, Int128>) {
            alignas(64) Int128 whole[row_piece];
            load_row(in_.type, in_.at(x, y, z), whole, n);
            for (std::int64_t i = 0; i < n; ++i) buffer[i] = distance(whole[i], field_.base);
            return buffer;
        } else {
            return driver::row_of<C>(in_, x, y, z, n, buffer);
        }
    }
    void store_whole(C const* distances, std::byte* to, std::int64_t n) {
        alignas(64) Int128 whole[row_piece];
        for (std::int64_t i = 0; i < n; ++i) whole[i] = from_distance(static_cast<double>(distances[i]), field_.base);
        store_row(out_.type, whole, to, n);
    }

    ConstView in_;
    AnyView out_;
    ClaheField const& field_;
    Columns<C> const& columns_;
    Window<C> window_;
    AxisBlend y_;
    std::int64_t points_; ///< of a row of bricks' curves
    bool blends_;
    std::vector<C> row_;
    Losses losses_;
};

template <class V, class C>
void map_all(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
             Execution const& execution) {
    C const* const all = reinterpret_cast<C const*>(curves.read(Space::host));
    Box const box = out.box;
    Index3 const n = box.dims();
    AxisBlend const y(field.grid, 1), z(field.grid, 2);
    Columns<C> const columns(field, box);
    // Curves of the bricks that the rows lie between.
    std::int64_t const row = (field.bins + 1) * field.grid.bricks.x,
                       begin = y.at(static_cast<double>(box.lower.y)).first * row,
                       end = (y.at(static_cast<double>(box.upper.y - 1)).second + 1) * row;
    int const threads = threads_for(execution, box.voxels());
    bool const by_slices = n.z >= threads;
    for_each_item(by_slices ? threads : 1, n.z, [&](std::int64_t first_slice, std::int64_t end_slice) {
        SliceCurves<C> slice(field, all);
        for (std::int64_t s = first_slice; s < end_slice; ++s) {
            slice.blend_at(z.at(static_cast<double>(box.lower.z + s)), begin, end);
            for_each_item(by_slices ? 1 : threads, n.y, [&](std::int64_t first_row, std::int64_t end_row) {
                RowMapper<V, C> rows(in, out, field, columns);
                for (std::int64_t r = first_row; r < end_row; ++r)
                    rows.map(box.lower.y + r, box.lower.z + s, slice.curves());
                driver::add(losses, rows.losses());
                stream_fence();
            });
        }
    });
}

#endif

} // namespace

void clahe_map(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
               Execution const& execution) {
    if (out.box.empty()) return;
    Losses found;
    if (field.whole)
        map_all<Int128, double>(in, out, field, curves, found, execution);
    else if (field.wide)
        map_all<double, double>(in, out, field, curves, found, execution);
    else
        map_all<float, float>(in, out, field, curves, found, execution);
    losses.clipped += found.clipped + found.undefined;
}

} // namespace VKT_BACKEND
} // namespace vkt
