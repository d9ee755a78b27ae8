// Ghost cells: a box of cells on a level's lattice, filled from whatever bricks there are.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/tile_output.h"
#include "libvkt/core/brick_sequence.h"

#include <list>
#include <unordered_map>

namespace vkt {

/// Where the cells of one level lie: cell (0,0,0) starts at `lower` (finest cells), dims cells cover the logical grid.
struct LevelLattice {
    int level = 0;
    Index3 lower, dims, width;
};

/// What is known of all cells of a volume once they were seen.
class CellSurvey {
public:
    explicit CellSurvey(DataType type) : type_(type) {}
    /// Some bricks with their cells one after another.
    void add(BrickTable const& bricks, std::byte const* cells, Execution const& execution);
    /// Smallest and largest cell, NaN left out.
    ValueRange range() const { return range_; }
    /// A brick without place and cells, as kernels want to see those of the volume.
    tile::Source brick() const;

private:
    DataType type_;
    ValueRange range_ = united({});
    std::uint64_t least_ = 0, most_ = 0; ///< of 64-bit integers
    bool any_ = false;
};

/// The cells of bricks, in memory or read when they are wanted; then those wanted last are kept.
class BrickCells {
public:
    /// Keeps up to `limit` bytes of what does not lie in memory. The sequence, of BrickOrder::any, must outlive it.
    BrickCells(BrickSequence& bricks, std::size_t limit) : bricks_(bricks), limit_(limit) {}

    /// From now until the next call these bricks' cells are there. Throws Error{resources} if they exceed the limit.
    void want(std::span<std::int32_t const> ids);
    std::byte const* of(std::int32_t id);
    BrickSequence& bricks() const { return bricks_; }

private:
    struct Kept {
        Buffer cells;
        std::list<std::int32_t>::iterator place;
    };

    BrickSequence& bricks_;
    std::size_t limit_, held_ = 0;
    std::list<std::int32_t> order_; ///< of what is kept, wanted last first
    std::unordered_map<std::int32_t, Kept> kept_;
};

/// Fills boxes of cells for operations that need neighbours. Cells that bricks of the same level hold are copied, bit
/// for bit; the others are reconstructed at the level's own spacing; outside the logical grid the boundary rule
/// decides. One instance per thread; cells and index must outlive it.
class GhostFiller {
public:
    GhostFiller(BrickCells& cells, BrickIndex const& index, tile::Source const& like, TileRule const& rule,
                InstructionSet instructions);

    /// out.box counts cells of the lattice and may leave it; out.type is the volume's. O(cells + log bricks).
    void fill(LevelLattice const& lattice, AnyView out, Boundary boundary, double border_value);

private:
    void fill_inside(LevelLattice const& lattice, AnyView out);
    void reconstruct(SampleGrid const& grid, AnyView out);

    BrickCells& cells_;
    BrickTable const& bricks_;
    BrickIndex const& index_;
    tile::Source like_;
    TileRule rule_;
    InstructionSet instructions_;
    TileWorkspace workspace_;
    std::vector<std::int32_t> near_, own_, places_;
    std::vector<tile::Source> sources_;
    std::vector<std::byte> folded_;
};

/// The lattice of a level; `any` is one of its bricks.
LevelLattice lattice_of(Index3 logical_dims, Brick const& any);

/// The cells of a brick on the lattice of its level.
Box lattice_box(LevelLattice const& lattice, Brick const& brick);

} // namespace vkt
