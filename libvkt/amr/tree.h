// Brick trees: cell widths, bounds, domains, validation, spatial index, ranges and statistics of hierarchical volumes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace vkt {

/// Finest cells per cell of a level along each axis: 2^level, but 1 along axes on which the logical grid is one cell
/// thick, so that 1-D and 2-D trees need no cells they do not have.
Index3 cell_width(Index3 logical_dims, int level);

/// The finest cells that a brick covers.
Box bounds_of(Brick const& brick, Index3 logical_dims);

/// The cells of a level, `width` finest cells wide, whose centres lie in a box of finest cells. May be empty.
Box cells_centred_in(Box const& region, Index3 width);

/// Where a brick contributes to the basis reconstruction: its bounds grown by half of its own cells. Counted in half
/// finest cells, which keeps it exact.
Box domain_of(Brick const& brick, Index3 logical_dims);

/// True if the open interior of the brick's domain meets [lower, upper) (finest cells, may be fractional).
bool domain_meets(Brick const& brick, Index3 logical_dims, Vec3 lower, Vec3 upper);

/// Number of finest cells in a box as a double: exact up to 2^53, never wraps.
double volume_of(Index3 dims);

/// Whether the bricks of a tree must cover its whole logical grid.
enum class Coverage : std::uint8_t { complete, may_have_holes };

/// Checks that bricks lie inside the logical grid, that bricks of one level share one lattice, that none overlap, and,
/// for complete trees, that their volume is that of the grid. Throws Error{data} naming the first culprit.
/// O(n log n); trees of equal blocks on the block lattice (FLASH) take one sort of integers.
void validate_tree(Index3 logical_dims, BrickTable const& bricks, Coverage coverage);

/// The part of it that takes O(n): each brick for itself and the lattices, not overlaps. For tables from readers that
/// may have lost their mind.
void check_bricks(Index3 logical_dims, BrickTable const& bricks);

/// The bricks of a stream or segment with this header, as BrickTable has them, none of which overlaps another. Throws
/// Error{data}. O(n log n).
BrickTable table_of_numbers(BrickPacking const& packing, std::vector<std::uint32_t> words, Header const& header);

/// What one level of a tree holds. Cell volumes are counted in finest cells.
struct LevelSummary {
    int level = 0;
    std::int64_t bricks = 0, cells = 0;
    double volume = 0;
};

struct TreeSummary {
    std::vector<LevelSummary> levels; ///< levels that hold bricks, finest first
    double covered = 0;               ///< finest cells that bricks cover
    double logical = 0;               ///< finest cells of the logical grid
    std::size_t table_bytes = 0;      ///< of the bricks' places
    double hole_share() const { return logical > 0 ? 1 - covered / logical : 0; }
};

TreeSummary summarise(Index3 logical_dims, BrickTable const& bricks);

/// True if the tree is all finest cells without holes, and with that as good as a structured volume.
bool is_uniform(Header const& header);

/// The stored value of what no brick covers: the attribute "background", which holds it in physical values, where the
/// source says that there is one (OpenVDB, refine). Cells of that value are as good as holes. None if the volume names
/// none. Throws Error{data} if the attribute is no number; in a structured volume it is somebody's own then, and none.
std::optional<double> stored_background(Header const& header);

/// Smallest and largest cell of a brick, NaN left out; minimum > maximum if it holds nothing but NaN.
struct ValueRange {
    double minimum = 0, maximum = 0;
    bool empty() const { return !(minimum <= maximum); }
};

/// Ranges of all bricks in order. Cells must lie in host memory or are migrated there.
std::vector<ValueRange> brick_ranges(Volume const& volume, Execution const& execution);
/// Those of bricks whose cells lie one after another.
std::vector<ValueRange> brick_ranges(std::byte const* cells, DataType type, BrickTable const& bricks,
                                     Execution const& execution);
/// Those of some bricks, in the order given.
std::vector<ValueRange> brick_ranges(Volume const& volume, std::span<std::size_t const> which,
                                     Execution const& execution);
ValueRange united(std::span<ValueRange const> ranges);

/// A node of the index: 32 bytes, boxes rounded outwards to float. Leaves (count > 0) name `count` entries of the order
/// list from `first`; inner nodes (count == 0) have their children at `first` and `first + 1`.
struct IndexNode {
    float lower[3], upper[3];
    std::int32_t first = 0, count = 0;
};

/// Bounding-volume hierarchy over brick domains, in finest cells. Build O(n log n), a query O(log n + hits).
class BrickIndex {
public:
    BrickIndex() = default;
    BrickIndex(Index3 logical_dims, BrickTable const& bricks);

    /// Ids of bricks whose domain may meet [lower, upper], ascending; up to three near misses come with each hit.
    void query(Vec3 lower, Vec3 upper, std::vector<std::int32_t>& ids) const;

    std::span<IndexNode const> nodes() const { return nodes_; }
    std::span<std::int32_t const> order() const { return order_; }

private:
    void split(std::int32_t node, std::int32_t begin, std::int32_t end, std::vector<float> const& boxes);

    std::vector<IndexNode> nodes_;
    std::vector<std::int32_t> order_;
};

} // namespace vkt
