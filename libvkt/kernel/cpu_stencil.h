// stencil on a CPU: rows of neighbours in one compute type, a register of voxels at a time.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cpu_drivers.h"
#include "libvkt/kernel/lanes.h"

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
        pitch_ = tile_columns + 2 * radius.x + 2 * lane_count<C>;
        high_ = tile_rows + 2 * radius.y;
        deep_ = 2 * radius.z + 1;
        values_.resize(static_cast<std::size_t>(pitch_ * high_ * deep_));
        rows_.resize(static_cast<std::size_t>((2 * radius.y + 1) * deep_));
    }
    void begin(Box const& tile) {
        tile_ = tile;
        loaded_ = tile.lower.z - radius_.z;
    }
    /// Neighbours of the output row (y, z); z ascends.
    C const* const* around(std::int64_t y, std::int64_t z) {
        for (; loaded_ <= z + radius_.z; ++loaded_) load(loaded_);
        std::int64_t const lines = 2 * radius_.y + 1;
        for (std::int64_t k = 0; k < deep_; ++k)
            for (std::int64_t j = 0; j < lines; ++j)
                rows_[static_cast<std::size_t>(k * lines + j)] =
                    line(z - radius_.z + k, y - tile_.lower.y + j) + radius_.x;
        return rows_.data();
    }

private:
    C* line(std::int64_t z, std::int64_t j) {
        std::int64_t const slot = (z - tile_.lower.z + radius_.z) % deep_;
        return values_.data() + (slot * high_ + j) * pitch_;
    }
    void load(std::int64_t z) {
        std::int64_t const n = tile_.dims().x + 2 * radius_.x, x = tile_.lower.x - radius_.x;
        for (std::int64_t j = 0; j < tile_.dims().y + 2 * radius_.y; ++j)
            for (std::int64_t i = 0; i < n; i += row_piece) {
                std::byte const* const from = in_.at(x + i, tile_.lower.y - radius_.y + j, z);
                std::int64_t const m = std::min(row_piece, n - i);
                if constexpr (std::is_floating_point_v<C>)
                    load_row(in_.type, from, line(z, j) + i, m);
                else // the voxels themselves
                    std::memcpy(line(z, j) + i, from, static_cast<std::size_t>(m) * sizeof(C));
            }
    }

    ConstView in_;
    Index3 radius_;
    Box tile_;
    std::int64_t pitch_, high_, deep_, loaded_ = 0;
    std::vector<C> values_;
    std::vector<C const*> rows_;
};

/// Results of type C as voxels: rounded, or as they are where C is an integer type.
template <class C> Losses store_results(AnyView out, std::byte* to, C const* values, std::int64_t n) {
    if constexpr (std::is_floating_point_v<C>)
        return store_row(out.type, values, to, n);
    else
        std::memcpy(to, values, static_cast<std::size_t>(n) * sizeof(C));
    return {};
}

} // namespace driver

template <class C, class F>
void stencil(Execution const& execution, AnyView out, Losses& losses, Index3 radius, F const& f, ConstView in) {
    using driver::NeighbourRows;
    if (out.box.empty()) return;
    Index3 const n = out.dims();
    auto const parts = [](std::int64_t a, std::int64_t b) { return (a + b - 1) / b; };
    // Tiles are as deep as leaves every thread some.
    std::int64_t const across = parts(n.x, NeighbourRows<C>::tile_columns),
                       along = parts(n.y, NeighbourRows<C>::tile_rows);
    std::int64_t const wanted = 4 * std::max(1, execution.threads);
    std::int64_t const deep =
        std::max<std::int64_t>(std::max<std::int64_t>(4, 4 * radius.z), parts(n.z * across * along, wanted));
    std::int64_t const layers = parts(n.z, std::min(deep, n.z)), tiles = across * along * layers;
    std::int64_t const work = out.box.voxels() * (2 * radius.x + 1) * (2 * radius.y + 1) * (2 * radius.z + 1);
    for_each_item(static_cast<int>(std::min<std::int64_t>(threads_for(execution, work), tiles)), tiles,
                  [&](std::int64_t first, std::int64_t last) {
                      NeighbourRows<C> rows(in, radius);
                      alignas(64) C results[NeighbourRows<C>::tile_columns + lane_count<C>];
                      F const local = f;
                      Losses mine;
                      for (std::int64_t tile = first; tile < last; ++tile) {
                          std::int64_t const i = tile % across, j = tile / across % along, k = tile / across / along;
                          Index3 const lower{out.box.lower.x + i * NeighbourRows<C>::tile_columns,
                                             out.box.lower.y + j * NeighbourRows<C>::tile_rows,
                                             out.box.lower.z + k * n.z / layers};
                          Box const box{lower,
                                        {std::min(lower.x + NeighbourRows<C>::tile_columns, out.box.upper.x),
                                         std::min(lower.y + NeighbourRows<C>::tile_rows, out.box.upper.y),
                                         out.box.lower.z + (k + 1) * n.z / layers}};
                          rows.begin(box);
                          std::int64_t const length = box.dims().x;
                          for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
                              for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                                  C const* const* const around = rows.around(y, z);
                                  for (std::int64_t x = 0; x < length; x += lane_count<C>)
                                      store_lanes(results + x, local(Window<C>(around, radius, x)));
                                  mine += driver::store_results(out, out.at(box.lower.x, y, z),
                                                                static_cast<C const*>(results), length);
                              }
                      }
                      driver::add(losses, mine);
                  });
}

} // namespace vkt::VKT_BACKEND
