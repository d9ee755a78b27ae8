// Where a resampled line takes its values from: for every output voxel of an axis the first input voxel and the
// weights.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/types.h"

#include <array>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

namespace vkt {

enum class ResampleKernel : std::uint8_t { identity, nearest, linear, area, cubic, bspline3, bspline5, lanczos3 };
std::string_view name_of(ResampleKernel kernel);

/// The table of one axis as kernels see it. Output voxel o is the sum over i of weight[start[o] + i] * in(first[o] +
/// i), 0 <= i < start[o + 1] - start[o], divided by the product of the axes' divisors.
struct AxisTable {
    std::int64_t const* first = nullptr;
    std::int64_t const* start = nullptr;
    double const* weight = nullptr;
    double const* pair =
        nullptr; ///< tables of at most two taps: both weights of every output, side by side, 0 for none
    double const* inside = nullptr; ///< Boundary::border: sum of the weights of every output; the rest is the border's
    double divisor = 1;
};

/// Where the voxels of one axis lie on a line of n_in others: output o at scale * o + offset, scale not 0.
struct LinePlacement {
    std::int64_t n_in, n_out;
    double scale, offset;
    /// Within 1e-9 of a whole number it is whole.
    double position(std::int64_t o) const;
};

/// Cell-centred sampling of n_in voxels at n_out: output o lies at (o + 1/2) n_in / n_out - 1/2. Positions are rational
/// and kept as such: linear and area weights are integers over one divisor, so that the products and sums of integer
/// voxels in double are exact (while they stay below 2^53) and the one division rounds correctly; constants are
/// reproduced. AxisTable beyond the ends are folded back (mirror, clamp), left outside for the engine to fill (wrap),
/// or left out (border). Weights that are zero at either end are left out, so that a NaN spreads no further than the
/// kernel's support.
class WeightTable {
public:
    WeightTable() = default;
    /// Throws Error{resources} if the table would need more than 2 GiB.
    WeightTable(std::int64_t n_in, std::int64_t n_out, ResampleKernel kernel, Boundary boundary);
    /// At any position, with weights in double that sum to 1; identity copies from whole positions. What lies outside
    /// at any distance is folded back, or moved to just outside for the engine to fill.
    WeightTable(LinePlacement const& placement, ResampleKernel kernel, Boundary boundary);

    ResampleKernel kernel() const { return kernel_; }
    double divisor() const { return divisor_; }
    /// Largest sum of |weight| of an output, over the divisor: by how much errors and values can grow. 1 where all
    /// are positive.
    double gain() const { return gain_; }
    /// Sum of |weights| that a spline's taps differ by from those of the infinite filter; 0 for other kernels.
    double cut() const { return cut_; }
    /// True if some weights fall on a constant border: AxisTable::inside says how much stays in the volume.
    bool leaves_out() const { return leaves_out_; }
    /// False for an output all of whose weights fall on a constant border.
    bool reaches(std::int64_t o) const;
    std::int64_t most_taps() const { return most_taps_; }
    /// How many input voxels lie between two outputs.
    double step() const { return step_; }
    std::int64_t outputs() const { return n_out_; }
    std::size_t bytes() const { return memory_.bytes(); }
    /// 2 if every output is the plain mean of two neighbours, 1 for the identity, else 0.
    int halving() const { return halving_; }
    /// The half-open input range that outputs [begin, end) need.
    std::pair<std::int64_t, std::int64_t> footprint(std::int64_t begin, std::int64_t end) const;
    /// The same, together with what later outputs need before it and earlier ones behind it, so that both ends only go
    /// forward: outputs that are voxels of the input need fewer than their neighbours.
    std::pair<std::int64_t, std::int64_t> footprint_forward(std::int64_t begin, std::int64_t end) const;
    /// True if no output begins to look further back than one before it, but for the reach of the kernel.
    bool ascends() const;
    AxisTable taps(Space space) const;

private:
    template <class LineAt> void build(std::int64_t n_in, std::int64_t n_out, Boundary boundary, LineAt const& line_at);

    ResampleKernel kernel_ = ResampleKernel::identity;
    std::int64_t n_out_ = 0, most_taps_ = 0, total_ = 0;
    double divisor_ = 1, gain_ = 1, step_ = 1, cut_ = 0;
    int halving_ = 0;
    bool leaves_out_ = false;                       ///< taps beyond the ends
    std::vector<std::int64_t> first_from_, end_to_; ///< of every output, see footprint_forward()
    mutable Buffer memory_; ///< first, start, weight, inside, one after the other; reading may copy it to the device
};

/// Per output voxel: a weighted sum of all rows in its footprint, and then of its columns; or, in passes, of slices, of
/// rows and of columns.
double multiply_adds(std::array<WeightTable, 3> const& tables);
/// Whether a sum by these tables is made in passes: of kernels with lobes, where that takes clearly fewer
/// multiply-adds. A matter of the tables alone, since the order of additions depends on it.
bool in_passes(std::array<WeightTable, 3> const& tables);

/// How much of a slice of the result is made at a time on CPUs: there is room for it in the second cache.
struct SumTile {
    static constexpr std::int64_t most_lanes = 16;

    SumTile() = default;
    explicit SumTile(std::array<WeightTable, 3> const& tables);

    std::int64_t lanes = 1;             ///< rows whose sums along x are made side by side: 1 or most_lanes
    std::int64_t x = 0, y = 0;          ///< voxels of the result, y a multiple of the lanes
    std::int64_t columns = 0, rows = 0; ///< about so many of the input, at most; rows that are kept in passes
    /// What a thread holds.
    std::int64_t bytes() const {
        return static_cast<std::int64_t>(sizeof(double)) * (columns * rows + (lanes + 1) * (columns + x));
    }
};

} // namespace vkt
