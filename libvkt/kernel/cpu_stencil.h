// stencil and column_stencil on a CPU: rows of neighbours in one compute type, a register of voxels at a time.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cpu_drivers.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/kernel/order.h"

#include <vector>

namespace vkt::VKT_BACKEND {

/// The neighbours of as many voxels of a row as a register holds. V is Lanes<C>: operators work lane by lane.
template <class C> class Window {
public:
    using Value = Lanes<C>;
    Window(C const* const* rows, Index3 radius, std::int64_t x) : rows_(rows), radius_(radius), x_(x) {}
    /// |dx|, |dy|, |dz| at most the radius.
    VKT_HD Value operator()(std::int64_t dx, std::int64_t dy, std::int64_t dz) const {
        return load_lanes(rows_[(dz + radius_.z) * (2 * radius_.y + 1) + dy + radius_.y] + x_ + dx);
    }

private:
    C const* const* rows_; ///< at the column of the first output voxel
    Index3 radius_;
    std::int64_t x_;
};

namespace driver {

/// Rows of the input around a tile of output rows, as C, slice by slice in a ring.
template <class C> class NeighbourRows {
public:
    static constexpr std::int64_t tile_rows = 8, tile_columns = row_piece;

    NeighbourRows(ConstView in, Index3 radius) : in_(in), radius_(radius) {
        // The column of the first output voxel begins a cache line; the last register reaches beyond the row.
        constexpr std::int64_t aligned = 64 / sizeof(C);
        lead_ = (radius.x + aligned - 1) / aligned * aligned;
        pitch_ = (lead_ + tile_columns + radius.x + 2 * lane_count<C> + aligned - 1) / aligned * aligned;
        high_ = tile_rows + 2 * radius.y;
        deep_ = 2 * radius.z + 1;
        values_.resize(static_cast<std::size_t>(pitch_ * high_ * deep_ + aligned));
        auto const skew = static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(values_.data()) / sizeof(C));
        first_ = values_.data() + (aligned - skew % aligned) % aligned;
        rows_.resize(static_cast<std::size_t>((2 * radius.y + tile_rows) * deep_));
    }
    NeighbourRows(NeighbourRows const&) = delete;
    NeighbourRows& operator=(NeighbourRows const&) = delete;
    void begin(Box const& tile) {
        tile_ = tile;
        loaded_ = tile.lower.z - radius_.z;
    }
    /// Neighbours of as many output rows from (y, z) on, of which some may lie beyond the tile; z ascends.
    C const* const* around(std::int64_t y, std::int64_t z, int together) {
        for (; loaded_ <= z + radius_.z; ++loaded_) load(loaded_);
        std::int64_t const lines = 2 * radius_.y + together;
        for (std::int64_t k = 0; k < deep_; ++k)
            for (std::int64_t j = 0; j < lines; ++j)
                rows_[static_cast<std::size_t>(k * lines + j)] = line(z - radius_.z + k, y - tile_.lower.y + j) + lead_;
        return rows_.data();
    }

private:
    C* line(std::int64_t z, std::int64_t j) {
        std::int64_t const slot = (z - tile_.lower.z + radius_.z) % deep_;
        return first_ + (slot * high_ + j) * pitch_;
    }
    void load(std::int64_t z) {
        std::int64_t const n = tile_.dims().x + 2 * radius_.x, x = tile_.lower.x - radius_.x;
        for (std::int64_t j = 0; j < tile_.dims().y + 2 * radius_.y; ++j)
            for (std::int64_t i = 0; i < n; i += row_piece) {
                std::byte const* const from = in_.at(x + i, tile_.lower.y - radius_.y + j, z);
                std::int64_t const m = std::min(row_piece, n - i);
                C* const to = line(z, j) + lead_ - radius_.x + i;
                if constexpr (std::is_floating_point_v<C>)
                    load_row(in_.type, from, to, m);
                else
                    load_keys(in_.type, from, to, m);
            }
    }

    ConstView in_;
    Index3 radius_;
    Box tile_;
    std::int64_t lead_, pitch_, high_, deep_, loaded_ = 0;
    std::vector<C> values_;
    C* first_;
    std::vector<C const*> rows_;
};

/// Results of type C as voxels: rounded, or those that have these keys.
template <class C> Losses store_results(AnyView out, std::byte* to, C const* values, std::int64_t n) {
    if constexpr (std::is_floating_point_v<C>)
        return store_row(out.type, values, to, n);
    else
        store_keys(out.type, values, to, n);
    return {};
}

/// Voxels from one row of results to the next.
template <class C>
inline constexpr std::int64_t results_pitch = NeighbourRows<C>::tile_columns + 64 / static_cast<int>(sizeof(C));

/// Calls make()(rows, n, results) for every row of at most tile_columns voxels of the output, or for `together` rows,
/// the last of which may be for nothing; make() once a thread, for its scratch.
/// rows[(dz + rz) * (2 ry + together) + dy + ry + r][x + dx] is a neighbour of voxel x of row r; results, those of row
/// r from r * results_pitch on, have room for a register more than n.
template <class C, int together = 1, class Make>
void for_each_row_of_neighbours(Execution const& execution, AnyView out, Losses& losses, Index3 radius, ConstView in,
                                Make const& make) {
    if (out.box.empty()) return;
    constexpr std::int64_t columns = NeighbourRows<C>::tile_columns, lines = NeighbourRows<C>::tile_rows;
    Index3 const n = out.dims();
    auto const parts = [](std::int64_t a, std::int64_t b) { return (a + b - 1) / b; };
    // Tiles are as deep as leaves every thread some.
    std::int64_t const across = parts(n.x, columns), along = parts(n.y, lines);
    std::int64_t const wanted = 4 * std::max(1, execution.threads);
    std::int64_t const deep =
        std::max<std::int64_t>(std::max<std::int64_t>(4, 4 * radius.z), parts(n.z * across * along, wanted));
    std::int64_t const layers = parts(n.z, std::min(deep, n.z)), tiles = across * along * layers;
    std::int64_t const work = out.box.voxels() * (2 * radius.x + 1) * (2 * radius.y + 1) * (2 * radius.z + 1);
    for_each_item(
        static_cast<int>(std::min<std::int64_t>(threads_for(execution, work), tiles)), tiles,
        [&](std::int64_t first, std::int64_t last) {
            NeighbourRows<C> rows(in, radius);
            static_assert(lines % together == 0);
            alignas(64) C results[together * results_pitch<C>];
            auto compute = make();
            Losses mine;
            for (std::int64_t tile = first; tile < last; ++tile) {
                tell_progress(execution, first, tile, last);
                std::int64_t const i = tile % across, j = tile / across % along, k = tile / across / along;
                Index3 const lower = out.box.lower + Index3{i * columns, j * lines, k * n.z / layers};
                Box const box{lower,
                              {std::min(lower.x + columns, out.box.upper.x), std::min(lower.y + lines, out.box.upper.y),
                               out.box.lower.z + (k + 1) * n.z / layers}};
                rows.begin(box);
                for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
                    for (std::int64_t y = box.lower.y; y < box.upper.y; y += together) {
                        compute(rows.around(y, z, together), box.dims().x, static_cast<C*>(results));
                        for (std::int64_t r = 0; r < std::min<std::int64_t>(together, box.upper.y - y); ++r)
                            mine += store_results(out, out.at(box.lower.x, y + r, z),
                                                  static_cast<C const*>(results + r * results_pitch<C>), box.dims().x);
                    }
            }
            add(losses, mine);
        });
}

} // namespace driver

template <class C, class F>
void stencil(Execution const& execution, AnyView out, Losses& losses, Index3 radius, F const& f, ConstView in) {
    driver::for_each_row_of_neighbours<C>(execution, out, losses, radius, in, [&] {
        return [radius, local = f](C const* const* rows, std::int64_t n, C* results) {
            for (std::int64_t x = 0; x < n; x += lane_count<C>)
                store_lanes(results + x, local(Window<C>(rows, radius, x)));
        };
    });
}

/// What column_stencil() made of the columns around as many voxels as a register holds.
template <class C> class ColumnWindow {
public:
    using Value = Lanes<C>;
    ColumnWindow(C const* values, std::int64_t pitch) : values_(values), pitch_(pitch) {}
    VKT_HD Value operator()(std::int64_t dx, int which) const { return load_lanes(values_ + which * pitch_ + dx); }

private:
    C const* values_; ///< of the first voxel
    std::int64_t pitch_;
};

template <class C, class F>
void column_stencil(Execution const& execution, AnyView out, Losses& losses, Index3 radius, F const& f, ConstView in) {
    // Pieces whose columns stay in the first cache.
    constexpr std::int64_t lanes = lane_count<C>, piece = 16 * lanes;
    std::int64_t const pitch = (piece + 2 * radius.x + lanes - 1) / lanes * lanes + lanes;
    driver::for_each_row_of_neighbours<C>(execution, out, losses, radius, in, [&] {
        return [=, local = f, columns = std::vector<C>(static_cast<std::size_t>(pitch * F::columns))](
                   C const* const* rows, std::int64_t n, C* results) mutable {
            for (std::int64_t begin = 0; begin < n; begin += piece) {
                std::int64_t const m = std::min(piece, n - begin);
                for (std::int64_t x = 0; x < m + 2 * radius.x; x += lanes) {
                    Lanes<C> made[F::columns];
                    local.column(Window<C>(rows, radius, begin + x - radius.x), made);
                    for (int k = 0; k < F::columns; ++k) store_lanes(columns.data() + k * pitch + x, made[k]);
                }
                for (std::int64_t x = 0; x < m; x += lanes)
                    store_lanes(results + begin + x,
                                local.combine(ColumnWindow<C>(columns.data() + radius.x + x, pitch)));
            }
        };
    });
}

} // namespace vkt::VKT_BACKEND
