// Macrocells: blocks of 8x8x8 lattice cells with the range of their values, for skipping and for majorants.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/render/tiles.h"
#include "libvkt/render/transfer.h"

#include <cstdint>
#include <vector>

namespace vkt::render {

/// Macrocell (i,j,k) holds the lattice cells [1+8i, 9+8i) of the padded lattice per axis; its range covers their corners.
struct CellGrid {
    int nx = 0, ny = 0, nz = 0;
    std::vector<float> lowest, highest; ///< lowest > highest where there is no data
    std::vector<std::uint8_t> missing;  ///< 1 where some corner has no data
};

/// Ranges of a padded lattice whose inner dims are given. Ignores NaN.
CellGrid make_cell_grid(LatticeView const& lattice, Index3 dims, int threads);

/// What a transfer function or iso-values make of the grid.
struct CellVisibility {
    std::vector<float> majorant;
    std::vector<std::uint8_t> visible;
    std::int64_t visible_count = 0;
};
CellVisibility classify_cells(CellGrid const& grid, TransferTable const& table);
CellVisibility classify_cells(CellGrid const& grid, IsoView const* isos, int count);

CellGridView view_of(CellGrid const& grid, CellVisibility const& visibility);

} // namespace vkt::render
