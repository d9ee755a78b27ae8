// Ghost cells: a box of cells on a level's lattice, filled from whatever bricks there are.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/tile_output.h"

namespace vkt {

/// Where the cells of one level lie: cell (0,0,0) starts at `lower` (finest cells), dims cells cover the logical grid.
struct LevelLattice {
    int level = 0;
    Index3 lower, dims, width;
};

/// Fills boxes of cells for operations that need neighbours. Cells that bricks of the same level hold are copied, bit
/// for bit; the others are reconstructed at the level's own spacing; outside the logical grid the boundary rule
/// decides. One instance per thread; the volume and index must outlive it.
class GhostFiller {
public:
    GhostFiller(Volume const& volume, BrickIndex const& index, std::span<tile::Source const> sources,
                TileRule const& rule, InstructionSet instructions);

    /// out.box counts cells of the lattice and may leave it; out.type is the volume's. O(cells + log bricks).
    void fill(LevelLattice const& lattice, AnyView out, Boundary boundary, double border_value);

private:
    void fill_inside(LevelLattice const& lattice, AnyView out);

    Volume const& volume_;
    BrickIndex const& index_;
    std::span<tile::Source const> sources_;
    TileRule rule_;
    InstructionSet instructions_;
    TileWorkspace workspace_;
    std::vector<std::int32_t> near_;
    std::vector<std::byte> folded_;
};

/// The lattice of a level; `any` is one of its bricks.
LevelLattice lattice_of(Index3 logical_dims, Brick const& any);

/// The cells of a brick on the lattice of its level.
Box lattice_box(LevelLattice const& lattice, Brick const& brick);

} // namespace vkt
