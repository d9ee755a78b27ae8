// CLAHE on CPUs: curves are blended along z once a slice and along y once a row where that is cheaper than for every
// voxel; the order of the blends is always the same.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/clahe.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/clahe_window.h"

#include <algorithm>
#include <type_traits>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

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
void map_blended(IntensityWindow<C> const window, C const* row, std::int32_t const* first, std::int32_t const* second,
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
void map_between(IntensityWindow<C> const window, C const* row, C const* upper, C const y, std::int32_t const* first,
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

template <class C> std::int64_t count_outside(IntensityWindow<C> const window, C const* values, std::int64_t n) {
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
    IntensityWindow<C> window_;
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
    for_each_item(execution, by_slices ? threads : 1, n.z, [&](std::int64_t first_slice, std::int64_t end_slice) {
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

template <class C> void store_curve(std::vector<double> const& curve, std::byte* curves, std::int64_t brick) {
    C* const to = reinterpret_cast<C*>(curves) + brick * static_cast<std::int64_t>(curve.size());
    for (std::size_t i = 0; i < curve.size(); ++i) to[i] = static_cast<C>(curve[i]);
}

} // namespace

void clahe_curves(std::uint64_t const* counts, ClaheField const& field, ClipLimit const& limit, std::byte* curves,
                  Execution const& execution) {
    std::int64_t const bins = field.bins, bricks = field.grid.count();
    constexpr std::int64_t worth_a_thread = 1 << 14; // bins: about 0.1 ms
    std::int64_t const most = std::clamp<std::int64_t>(bricks * bins / worth_a_thread, 1, 1 << 10);
    int const threads = static_cast<int>(std::min<std::int64_t>(execution.threads, most));
    for_each_item(threads, bricks, [&](std::int64_t begin, std::int64_t end) {
        std::vector<std::uint64_t> heights(static_cast<std::size_t>(bins));
        for (std::int64_t b = begin; b < end; ++b) {
            std::uint64_t const* const from = counts + b * (bins + 3);
            std::copy_n(from, bins, heights.begin());
            heights.front() += from[bins];
            heights.back() += from[bins + 1];
            std::vector<double> const curve = clipped_curve(heights, limit);
            if (field.wide)
                store_curve<double>(curve, curves, b);
            else
                store_curve<float>(curve, curves, b);
        }
    });
}

void clahe_map(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
               Execution const& execution) {
    if (out.box.empty()) return;
    clahe_in_type(field, losses, [&]<class V, class C>(V, C, Losses& found) {
        map_all<V, C>(in, out, field, curves, found, execution);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
