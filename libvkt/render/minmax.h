// Macrocells: blocks of 8x8x8 lattice cells with the range of their values, for skipping and for majorants.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/render/tiles.h"
#include "libvkt/render/transfer.h"

#include <cstdint>
#include <vector>

namespace vkt::render {

/// Macrocell (i,j,k) holds the lattice cells [1+8i, 9+8i) of the padded lattice per axis; its range covers their
/// corners.
struct CellGrid {
    int nx = 0, ny = 0, nz = 0;
    std::vector<float> lowest, highest; ///< lowest > highest where there is no data
    std::vector<std::uint8_t> missing;  ///< 1 where some corner has no data
};

/// Ranges of a padded lattice whose inner dims are given. Ignores NaN.
CellGrid make_cell_grid(LatticeView const& lattice, Index3 dims, int threads);

/// Values of a part of a volume; lowest > highest where there is no data.
struct PartRange {
    float lowest = 0, highest = 0;
    std::int64_t resolution = 1; ///< those of smaller parts than cubes so wide tell no more
};
/// Of these voxels, both ends included; of the padding those count that are next to the volume.
PartRange range_of_voxels(LatticeView const& lattice, Index3 dims, Index3 first, Index3 last);

/// What a transfer function or iso-values make of the grid.
struct CellVisibility {
    std::vector<float> majorant;
    std::vector<std::uint8_t> distance; ///< Chebyshev distance to the nearest visible cell
    std::vector<std::uint8_t> depth;    ///< the same to the nearest other cell; of transfer functions only
    std::int64_t visible_count = 0;
    int first[3] = {0, 0, 0}, last[3] = {-1, -1, -1}; ///< box of the visible cells; empty if there is none
};
/// Whether one of the surfaces lies between values of this range.
bool meets(std::vector<IsoView> const& isos, float lowest, float highest);
CellVisibility classify_cells(CellGrid const& grid, TransferTable const& table);
CellVisibility classify_cells(CellGrid const& grid, std::vector<IsoView> const& isos);
/// Labels: all that is not this value can be seen.
CellVisibility classify_cells(CellGrid const& grid, float nothing);

CellGridView view_of(CellGrid const& grid, CellVisibility const& visibility);

} // namespace vkt::render
