// Hierarchical to structured: basis, nearest, average (conservative) and automatic reconstruction on a regular grid.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/kernels/tile.h"
#include "libvkt/amr/tree.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/roi.h"

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt {

/// How cells become samples.
/// basis: normalised sum of cell-width hat functions over leaf cells (ExaBricks, Wald et al. 2021): C0, never over- or
///   undershoots, trilinear with clamped edges inside a level; off by at most half a fine cell times the gradient at
///   2:1 boundaries.
/// nearest: the cell that holds the sample.
/// average: volume-weighted mean of the cells that a voxel overlaps, and of the background where it overlaps none;
///   conserves the integral.
/// automatic: average everywhere if the grid looks into a hole, since basis reaches half a cell into it, which costs
/// the
///   integral; otherwise average where a voxel is at least two cells wide, and basis elsewhere.
enum class Reconstruction : std::uint8_t { basis, nearest, average, automatic };

template <> struct EnumNames<Reconstruction> {
    static std::vector<std::pair<Reconstruction, char const*>> all() {
        return {{Reconstruction::basis, "basis"},
                {Reconstruction::nearest, "nearest"},
                {Reconstruction::average, "average"},
                {Reconstruction::automatic, "auto"}};
    }
};

/// A regular grid over a region of the logical grid: sample i of an axis lies at lower + (i + 1/2) * step, in finest
/// cells. Positions are evaluated in double per axis, so far ends of long domains lose nothing.
struct SampleGrid {
    Vec3 lower, step{1, 1, 1};
    Index3 dims{1, 1, 1};
};

/// What all parts of a reconstruction share.
struct TileRule {
    Reconstruction method = Reconstruction::basis;
    double background = 0;  ///< stored value where there is no brick
    Vec3 extent{1, 1, 1};   ///< of the logical grid, in finest cells: what lies outside is no part of a mean
    ValueRange range{1, 0}; ///< of the cells: weighted sums, which round, do not leave it; empty if nobody knows
    bool holes = false;     ///< automatic: samples may lie in holes, and are averages there, however near a cell is
};

/// What a user asks for. At most one of dims, spacing and cells; none samples every finest cell.
struct GridRequest {
    std::optional<Index3> dims;
    std::optional<Vec3> spacing;       ///< world units per output voxel
    std::optional<std::int64_t> cells; ///< about this many output voxels, cubes in world units as nearly as possible
    Roi roi;                           ///< in finest cells
    WorldRoi world_roi;                ///< in world units: the finest cells whose centres lie inside
};

/// The box of finest cells a hierarchical volume stands for: its "roi" attribute if it was cropped, else everything.
/// Throws Error{data} if the attribute is malformed.
Box region_of(Header const& header);
/// The box of a region of a hierarchical volume. A bound that is left open is that of the volume's own region: the
/// lattice of OpenVDB's blocks is larger than what they hold. All others count on the whole lattice.
Box resolve_in_tree(Roi const& roi, Header const& header);
/// The same in the world; what sticks out of the volume's own region is left off. Throws Error{usage} if nothing is
/// left.
Box resolve_in_tree(WorldRoi const& roi, Header const& header);
/// Throws Error{usage} if a region is empty or leaves the volume's own.
void require_in_region(Box const& region, Header const& header);

/// Throws Error{usage} for contradictory requests and empty regions.
SampleGrid plan_grid(Header const& header, GridRequest const& request);

/// The structured header of such a grid: dims, geometry, type; values, units and attributes travel along.
Header gridded_header(Header const& header, SampleGrid const& grid);

/// True if bricks leave part of the grid uncovered. What lies outside the logical grid is no hole. O(bricks).
bool leaves_holes(Header const& header, BrickTable const& bricks, SampleGrid const& grid);

class DeviceSampler;

/// Samples a hierarchical volume on a grid, region by region. Results depend on neither regions nor threads, bit for
/// bit; bricks contribute in their order. State: 112 bytes a brick. Throws Error{failure} for structured volumes.
class Reconstructor {
public:
    Reconstructor(Volume volume, SampleGrid const& grid, Reconstruction method, double background = 0);

    /// Computes the samples of out.box, in the volume's type and the memory of the execution's device; where no brick
    /// contributes they become the background, which also has its share in means over voxels that bricks cover in part,
    /// unless it is not finite. Samples keep to the range of the cells, and that share to the range between them and
    /// the background. `mask`, if not empty, is a uint8 view of the same box: 1 where bricks contribute, else 0.
    /// O(samples + bricks near the region). On a GPU what DeviceSampler computes, without a mask.
    void run(AnyView out, AnyView mask, Execution const& execution) const;
    void run(AnyView out, Execution const& execution) const { run(out, AnyView{}, execution); }

    Header header() const { return gridded_header(volume_.header(), grid_); }
    /// Memory besides the cells.
    static constexpr std::size_t bytes_per_brick = sizeof(tile::Source) + 2 * sizeof(std::int64_t);
    std::size_t state_bytes() const { return sources_.size() * bytes_per_brick; }

private:
    ValueRange range_near_grid() const;
    void bin(Box const& region, Index3 const& tiles, Index3 const& first_tile, std::vector<std::int64_t>& starts,
             std::vector<std::int32_t>& ids) const;

    Volume volume_;
    SampleGrid grid_;
    TileRule rule_;
    std::vector<tile::Source> sources_;
    std::vector<std::int64_t> first_z_, last_z_;    ///< per brick: output slices it may touch
    mutable std::shared_ptr<DeviceSampler> on_gpu_; ///< once it was asked for
};

/// The whole grid at once. `mask`, if given, receives a uint8 volume of the same grid.
Volume reconstruct(Volume const& volume, SampleGrid const& grid, Reconstruction method, double background,
                   Execution const& execution, Volume* mask = nullptr);

} // namespace vkt
