// Macrocells: ranges by rows first (which vectorises), then along x.
// SPDX-License-Identifier: MIT
#include "libvkt/render/minmax.h"

#include <algorithm>
#include <limits>
#include <omp.h>

namespace vkt::render {

namespace {

int cell_count(std::int64_t n) { return static_cast<int>((n + 1 + macrocell_size - 1) / macrocell_size); }

/// Range and missing flags of the macrocells with one (j, k): all corners of their cells.
template <class T>
void range_of_row(LatticeView const& lattice, Index3 dims, int j, int k, CellGrid& grid, T* low, T* high,
                  std::uint8_t* nan) {
    constexpr std::int64_t first = lattice_padding - 1;
    std::int64_t const y0 = first + macrocell_size * j, z0 = first + macrocell_size * k;
    std::int64_t const y1 = std::min(y0 + macrocell_size, dims.y + lattice_padding);
    std::int64_t const z1 = std::min(z0 + macrocell_size, dims.z + lattice_padding);
    std::int64_t const n = dims.x + 2; // corners first … first + dims.x + 1
    constexpr bool floating = std::is_same_v<T, float>;
    T const most = floating ? std::numeric_limits<T>::infinity() : std::numeric_limits<T>::max();
    T const least = floating ? -std::numeric_limits<T>::infinity() : std::numeric_limits<T>::lowest();
    std::fill(low, low + n, most);
    std::fill(high, high + n, least);
    if constexpr (floating) std::fill(nan, nan + n, std::uint8_t{0});
    for (std::int64_t z = z0; z <= z1; ++z)
        for (std::int64_t y = y0; y <= y1; ++y) {
            T const* row = static_cast<T const*>(lattice.data) + first + y * lattice.row + z * lattice.slice;
            for (std::int64_t x = 0; x < n; ++x) {
                low[x] = row[x] < low[x] ? row[x] : low[x];
                high[x] = row[x] > high[x] ? row[x] : high[x];
            }
            if constexpr (floating)
                for (std::int64_t x = 0; x < n; ++x)
                    nan[x] = static_cast<std::uint8_t>(nan[x] | (std::isnan(row[x]) ? 1 : 0));
        }
    for (int i = 0; i < grid.nx; ++i) {
        std::int64_t const x0 = macrocell_size * static_cast<std::int64_t>(i),
                           x1 = std::min<std::int64_t>(x0 + macrocell_size, n - 1);
        std::size_t const cell = (static_cast<std::size_t>(k) * grid.ny + j) * grid.nx + i;
        T const lowest = *std::min_element(low + x0, low + x1 + 1),
                highest = *std::max_element(high + x0, high + x1 + 1);
        grid.lowest[cell] = static_cast<float>(lowest);
        grid.highest[cell] = static_cast<float>(highest);
        if constexpr (floating) grid.missing[cell] = *std::max_element(nan + x0, nan + x1 + 1);
    }
}

template <class T> void ranges(LatticeView const& lattice, Index3 dims, CellGrid& grid, int threads) {
    std::int64_t const rows = static_cast<std::int64_t>(grid.ny) * grid.nz;
    struct Row {
        std::vector<T> low, high;
        std::vector<std::uint8_t> nan;
    };
    auto const n = static_cast<std::size_t>(dims.x + 2);
    std::vector<Row> own; // made here, where it may be said that there is no memory
    own.reserve(static_cast<std::size_t>(threads));
    for (int t = 0; t < threads; ++t)
        own.push_back({std::vector<T>(n), std::vector<T>(n), std::vector<std::uint8_t>(n)});
#pragma omp parallel num_threads(threads)
    {
        Row& mine = own[static_cast<std::size_t>(omp_get_thread_num())];
#pragma omp for schedule(dynamic, 8)
        for (std::int64_t r = 0; r < rows; ++r)
            range_of_row(lattice, dims, static_cast<int>(r % grid.ny), static_cast<int>(r / grid.ny), grid,
                         mine.low.data(), mine.high.data(), mine.nan.data());
    }
}

/// Turns 0 and 255 into distances from the nearest 0 by two sweeps over the 26 neighbours (exact for this metric).
void spread(CellGrid const& grid, std::vector<std::uint8_t>& distance) {
    std::int64_t const nx = grid.nx, ny = grid.ny, nz = grid.nz;
    auto const sweep = [&](std::int64_t way) {
        for (std::int64_t k = 0; k < nx * ny * nz; ++k) {
            std::int64_t const i = way > 0 ? k : nx * ny * nz - 1 - k;
            std::int64_t const x = i % nx, y = i / nx % ny, z = i / (nx * ny);
            int least = distance[static_cast<std::size_t>(i)];
            for (int n = 0; n < 13 && least > 1; ++n) { // the half of the neighbours that come before
                std::int64_t const u = x + way * (n % 3 - 1), v = y + way * (n / 3 % 3 - 1), w = z + way * (n / 9 - 1);
                if (u < 0 || v < 0 || w < 0 || u >= nx || v >= ny || w >= nz) continue;
                least = std::min(least, distance[static_cast<std::size_t>((w * ny + v) * nx + u)] + 1);
            }
            distance[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(least);
        }
    };
    sweep(1);
    sweep(-1);
}

/// From 0 (visible) and 255 in `distance`: distances, and how many cells are visible and where.
void measure(CellGrid const& grid, CellVisibility& result) {
    std::int64_t const nx = grid.nx, ny = grid.ny, nz = grid.nz;
    bool some = false;
    for (std::int64_t i = 0; i < nx * ny * nz; ++i) {
        if (result.distance[static_cast<std::size_t>(i)] != 0) continue;
        int const at[3] = {static_cast<int>(i % nx), static_cast<int>(i / nx % ny), static_cast<int>(i / (nx * ny))};
        for (int axis = 0; axis < 3; ++axis) {
            result.first[axis] = some ? std::min(result.first[axis], at[axis]) : at[axis];
            result.last[axis] = std::max(result.last[axis], at[axis]);
        }
        some = true;
        ++result.visible_count;
    }
    if (result.visible_count < nx * ny * nz) spread(grid, result.distance);
}

} // namespace

CellGrid make_cell_grid(LatticeView const& lattice, Index3 dims, int threads) {
    CellGrid grid;
    grid.nx = cell_count(dims.x), grid.ny = cell_count(dims.y), grid.nz = cell_count(dims.z);
    auto const n =
        static_cast<std::size_t>(grid.nx) * static_cast<std::size_t>(grid.ny) * static_cast<std::size_t>(grid.nz);
    grid.lowest.resize(n);
    grid.highest.resize(n);
    grid.missing.resize(n);
    with_lattice_type(lattice.type, [&]<class T>(T) { ranges<T>(lattice, dims, grid, threads); });
    return grid;
}

PartRange range_of_voxels(LatticeView const& lattice, Index3 dims, Index3 first, Index3 last) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    PartRange range{infinity, -infinity};
    for (int axis = 0; axis < 3; ++axis) last[axis] = std::min(last[axis], dims[axis]);
    with_lattice_type(lattice.type, [&]<class T>(T) {
        for (std::int64_t z = first.z; z <= last.z; ++z)
            for (std::int64_t y = first.y; y <= last.y; ++y) {
                T const* const row = static_cast<T const*>(lattice.data) + lattice_padding +
                                     (y + lattice_padding) * lattice.row + (z + lattice_padding) * lattice.slice;
                for (std::int64_t x = first.x; x <= last.x; ++x) {
                    auto const v = static_cast<float>(row[x]);
                    range.lowest = v < range.lowest ? v : range.lowest;
                    range.highest = v > range.highest ? v : range.highest;
                }
            }
    });
    if (range.lowest == range.highest) range.resolution = macrocell_size;
    return range;
}

bool meets(std::vector<IsoView> const& isos, float lowest, float highest) {
    return std::any_of(isos.begin(), isos.end(),
                       [&](IsoView const& iso) { return lowest < iso.value && highest >= iso.value; });
}

CellVisibility classify_cells(CellGrid const& grid, TransferTable const& table) {
    CellVisibility result;
    std::size_t const n = grid.lowest.size();
    result.majorant.resize(n);
    result.distance.resize(n);
    result.depth.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
        // A little more than the greatest value, because interpolation rounds.
        float const majorant = table.greatest_extinction(grid.lowest[i], grid.highest[i]) * (1.0F + 0x1p-18F);
        result.majorant[i] = majorant;
        // Beyond missing data the value may jump between two samples, so that such cells count as visible.
        result.distance[i] = majorant > 0 || grid.missing[i] != 0 ? 0 : 255;
    }
    for (std::size_t i = 0; i < n; ++i) result.depth[i] = static_cast<std::uint8_t>(255 - result.distance[i]);
    measure(grid, result);
    spread(grid, result.depth);
    return result;
}

CellVisibility classify_cells(CellGrid const& grid, std::vector<IsoView> const& isos) {
    CellVisibility result;
    std::size_t const n = grid.lowest.size();
    result.majorant.assign(n, 0.0F);
    result.distance.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
        bool visible = grid.missing[i] != 0 || !(grid.lowest[i] <= grid.highest[i]); // a hole is on neither side
        visible = visible || meets(isos, grid.lowest[i], grid.highest[i]);
        result.distance[i] = visible ? 0 : 255;
    }
    measure(grid, result);
    return result;
}

CellVisibility classify_cells(CellGrid const& grid, float nothing) {
    CellVisibility result;
    std::size_t const n = grid.lowest.size();
    result.majorant.assign(n, 0.0F);
    result.distance.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
        // What has no data ranges from +inf to -inf.
        bool const some = grid.lowest[i] <= grid.highest[i] && (grid.lowest[i] < nothing || grid.highest[i] > nothing);
        result.distance[i] = some ? 0 : 255;
    }
    measure(grid, result);
    return result;
}

CellGridView view_of(CellGrid const& grid, CellVisibility const& visibility) {
    return {grid.lowest.data(),
            visibility.majorant.data(),
            visibility.distance.data(),
            visibility.depth.data(),
            grid.nx,
            grid.ny,
            grid.nz};
}

} // namespace vkt::render
