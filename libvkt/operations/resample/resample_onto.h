// Resampling onto another volume's grid: how the two grids lie to each other, and the way that takes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/boundary_rule.h"
#include "libvkt/engine/error_bound.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/resample/kernels/affine.h"
#include "libvkt/operations/resample/resample_method.h"
#include "libvkt/operations/resample/resample_weights.h"
#include "libvkt/operations/resample/spline_coefficients.h"

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Positions so near, in voxels, are the same.
inline constexpr double same_voxel = 1e-6;

/// An output grid in voxels of the input.
struct Placement {
    Affine map; ///< output index to input index
    /// Every axis of the output runs along one of the input: position along axis[a] = scale[a] * o[a] + offset[a].
    bool aligned = false;
    std::array<int, 3> axis{0, 1, 2};
    Vec3 scale{1, 1, 1}, offset;

    /// Aligned, axes in order and direction kept.
    bool upright() const {
        return aligned && axis == std::array<int, 3>{0, 1, 2} && scale.x > 0 && scale.y > 0 && scale.z > 0;
    }
    /// Aligned, and every output voxel is one of the input's lattice.
    bool whole() const;
    /// Axes of the input along which voxels of the output lie between its voxels.
    std::array<bool, 3> between() const;
    /// True if voxels of the output are wider than the input's along an axis.
    bool coarser() const;
    /// Upright, and the outer faces of both are the same.
    bool keeps_extent(Index3 from, Index3 to) const;
};

/// How a grid of `dims` voxels lies in an input. Positions within 1e-6 voxels of the input's lattice, all of them, are
/// on it; what else rounding left in the map is taken out where it moves no voxel by more than 1e-9. Throws Error{data}
/// if the map is not finite.
Placement place(Geometry const& grid, Index3 dims, Geometry const& input);
/// The same for a map of indices.
Placement place(Affine const& map, Index3 dims);

/// What values are on either side.
struct OntoValues {
    DataType in = DataType::uint8, out = DataType::uint8;
    double scale = 1, offset = 0; ///< from stored values of the input to those of the result
    double background = 0;        ///< stored in the result where its voxels have their centres outside the input
    double border = 0;            ///< stored in the input, for Boundary::border
};

/// "N of M voxels (P %) outside the volume: background", `what` being "the volume", and which background it is where
/// that is another than was meant: a physical value.
Remark outside_remark(std::int64_t outside, std::int64_t voxels, std::string const& what,
                      std::optional<double> const& other_background);

/// What lies outside, as it is stored in the output.
struct Background {
    double stored = 0;
    bool other = false; ///< it is not the one that was meant, but the nearest that can be stored
};

/// The background as given, else what the input names as its own, else 0; of these two the nearest that the type can
/// hold under the output's value map. Throws Error{usage} if the type cannot hold the given one.
Background background_in(Header const& output, std::optional<double> given, Header const& input);

/// Puts a volume onto a grid. Along aligned axes, with weights in tables, each axis on its own, as on grids of the same
/// extent; axes that changed places are put back first. Turned grids are sampled by an interpolant at any position;
/// where their voxels are wider than the input's the mean of several samples is taken, except for nearest and linear.
/// Splines are made of coefficients that are computed once for all of the input, or for every region anew. Without a
/// boundary rule the voxels at the faces continue for half a voxel, and beyond there is background.
class Onto {
public:
    Onto(Placement placement, Index3 from, Index3 to, ResampleMethod method, std::optional<BoundaryRule> boundary,
         OntoValues const& values);

    /// From now on footprint() and run() take the coefficients that the returned operation makes of the input, for
    /// splines on turned grids; null for all others. See Prepared.
    Operation* take_coefficients();

    /// Method, error, cost, state, shift and order of access.
    void describe(Plan& plan) const;
    /// How errors of the input pass into plan.output, as described.
    void pass(Header const& input, Plan& plan) const;
    Box footprint(Box const& output) const;
    Placement const& placement() const { return placement_; }
    /// Bytes held for regions of this extent: the input with its axes in order, and what every thread sums up.
    std::size_t fit(Index3 largest, Execution const& execution) const;
    /// Bytes held besides a region of so many voxels and its footprint.
    std::size_t held(Index3 largest) const;
    void run(ConstView in, AnyView out, Losses& losses, Execution const& execution);
    /// Voxels of what was computed that became background.
    std::int64_t outside() const { return outside_; }
    std::int64_t* outside_counter() { return &outside_; }

private:
    enum class Algorithm : std::uint8_t { copy, convert, nearest, weighted, turned_nearest, turned };

    ErrorBound error_of(Header const& output, double steps) const;
    double gain() const;
    void plan_aligned();
    void plan_turned();
    Box sampled(Box const& output) const;
    Box turned_footprint(Box const& output) const;
    void run_spline(ConstView in, AnyView out, Losses& losses, Execution const& execution);
    void run_aligned(ConstView in, AnyView out, Losses& losses, Execution const& execution);
    ConstView with_axes_in_order(ConstView in, Execution const& execution);

    Placement placement_;
    Index3 from_, to_;
    ResampleMethod method_;
    std::optional<BoundaryRule> boundary_;
    OntoValues values_;
    Algorithm algorithm_ = Algorithm::turned;
    std::array<WeightTable, 3> tables_; ///< aligned: of the output's axes
    Box inner_;               ///< aligned: output voxels with centres in the input, or that follow the boundary
    AffineSampling sampling_; ///< turned
    SplineRule spline_;       ///< … by a spline
    std::vector<double> filter_weights_;
    std::unique_ptr<SplineCoefficients> preparation_; ///< if coefficients are taken
    std::int64_t outside_ = 0;
    Buffer ordered_, scratch_, coefficients_, wider_;
};

} // namespace vkt
