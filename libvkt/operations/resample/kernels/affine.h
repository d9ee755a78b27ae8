// Sampling a volume at positions that an affine map gives: what the kernel is told.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/affine.h"
#include "libvkt/kernel/numeric.h"

#include <optional>

namespace vkt {

enum class Interpolant : std::uint8_t {
    nearest,  ///< the voxel whose cell holds the position; of two the later one
    linear,   ///< between the 8 voxels around it
    cubic,    ///< Keys' cubic convolution with a = -1/2, of 64 voxels
    bspline3, ///< the spline of degree 3 through the voxels: of 64 coefficients
    bspline5, ///< of degree 5: of 216
    lanczos3, ///< sinc windowed by a sinc three times as wide, weights made to sum to 1: of 216 voxels
};

/// Voxels around a position that the interpolant looks at: `before` below its floor, `after` above.
struct Reach {
    std::int64_t before, after;
};
constexpr Reach reach_of(Interpolant interpolant) {
    if (interpolant == Interpolant::cubic || interpolant == Interpolant::bspline3) return {1, 2};
    if (interpolant == Interpolant::bspline5 || interpolant == Interpolant::lanczos3) return {2, 3};
    return {0, 1}; // nearest: the floor or the one above
}
/// 0 for what looks at voxels, not at the coefficients of a spline.
constexpr int spline_degree(Interpolant interpolant) {
    return interpolant == Interpolant::bspline3 ? 3 : interpolant == Interpolant::bspline5 ? 5 : 0;
}

/// Output voxel o is the interpolated value at map(o), in voxels of the input. Positions are computed anew for every
/// voxel, so that results do not depend on how the output is cut; within 1e-9 of a whole number they are whole, so that
/// what rounding leaves lets no voxel take part that should not.
struct AffineSampling {
    Affine map;
    Interpolant interpolant = Interpolant::linear;
    Index3 dims;             ///< of the input volume
    Index3 samples{1, 1, 1}; ///< more than one: the mean of so many samples spread evenly over the output voxel's cell
    /// How the input continues outside. Without it the voxels at its faces do so for half a voxel, and voxels whose
    /// centres lie beyond become the background.
    std::optional<Boundary> boundary;
    /// Splines: coefficients go on so far beyond the faces before they are constant, if the volume is there; see also
    /// beyond_along().
    std::int64_t beyond = 0;
    double border = 0;            ///< stored value, for Boundary::border
    double background = 0;        ///< stored value of the result
    double scale = 1, offset = 0; ///< from stored values of the input to those of the result
    /// Linear, of types that float32 holds, without a scale or several samples: values are interpolated in float32.
    bool single = false;
};

/// So far coefficients go on beyond the faces of n voxels: not where there is one, and what continues it is the same.
VKT_HD constexpr std::int64_t beyond_along(std::int64_t n, std::int64_t beyond, Boundary boundary) {
    return n == 1 && boundary != Boundary::border ? 0 : beyond;
}

/// Half-open range [-1/2, n - 1/2) of positions that lie in a line of n cells. What rounding moves from one side of a
/// face to the other is taken as lying on it, like a tie between two voxels.
inline constexpr double face_slack = 1e-6;
VKT_HD double first_position() { return -0.5 - face_slack; }
VKT_HD double end_position(std::int64_t n) { return static_cast<double>(n) - 0.5 - face_slack; }

/// Voxels of the result that a CPU samples together: what they look at stays in its caches, and where an axis stays,
/// the slices share their places. Not inline: one object for all would have the instructions of one of them.
constexpr Index3 affine_tile{64, 16, 16};

/// `in` holds voxels, or the coefficients of a spline as float32 or float64.
VKT_KERNEL(affine_sample,
           (ConstView in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
            Execution const& execution),
           (in, out, rule, losses, outside, execution))
VKT_KERNEL(affine_nearest,
           (ConstView in, AnyView out, AffineSampling const& rule, std::int64_t& outside, Execution const& execution),
           (in, out, rule, outside, execution))
} // namespace vkt
