// The Gaussian by way of a coarser lattice: B-splines that thin out and refine, a small Gaussian between them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/gaussian_taps.h"

#include <array>
#include <optional>

namespace vkt {

/// One axis: means weighted by a B-spline of `step` voxels a knot, taken at every step-th voxel from voxel 0 of the
/// volume on; a Gaussian on these nodes; and the spline that has its results for coefficients, read off at the voxels.
/// With step 1 the nodes are the voxels, and the Gaussian is all there is. Weights are positive and add up to 1, as
/// nested averages (see GaussianTaps), so that constants stay as they are and results in the range of the data. Nodes
/// lie outside the volume as well, made of voxels that the boundary rule says: no rule is approximated.
struct CascadeAxis {
    std::int64_t step = 1;
    GaussianTaps before; ///< the thinning spline
    GaussianTaps coarse; ///< between the nodes
    /// The refining spline: voxel i reads `taps` nodes from floor(i / step) - left on, nested in the order of tap(). Of
    /// each of `step` phases the shares of all but the first.
    std::int64_t left = 0, taps = 1;
    std::vector<double> shares;
    std::vector<float> single_shares;
    double truncation = 0; ///< half the L1 distance to the infinite kernel, the largest of all phases

    /// Which of the nodes comes k-th: from the outermost to those in the middle.
    std::int64_t tap(std::int64_t k) const { return k % 2 == 0 ? k / 2 : taps - 1 - k / 2; }
    /// Bound of the rounding error of all three; unit is half the spacing at 1 of the type it computes in.
    GaussianRounding rounding(double unit) const;
    /// Most nodes that n voxels read, refined and before the Gaussian, and most voxels that the latter are made of.
    std::int64_t nodes(std::int64_t n) const { return (n + step - 2) / step + taps; }
    std::int64_t wide_nodes(std::int64_t n) const { return nodes(n) + 2 * coarse.radius; }
    std::int64_t reach(std::int64_t n) const { return wide_nodes(n) * step + 2 * before.radius; }
};

/// The whole number at or below a / b, b > 0.
constexpr std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a >= 0 ? a / b : -((b - 1 - a) / b); }

/// Positions from `lower` to before `upper`: voxels or nodes.
struct Span {
    std::int64_t lower = 0, upper = 0;
    std::int64_t size() const { return upper - lower; }
};
/// Nodes that a span of voxels reads; those under the Gaussian; and the voxels that these are made of, with what
/// mirrors into them at the upper end.
Span nodes_under(CascadeAxis const& axis, Span voxels);
Span wide_nodes_under(CascadeAxis const& axis, Span voxels);
Span voxels_under(CascadeAxis const& axis, Span voxels);

struct GaussianCascade {
    std::array<CascadeAxis, 3> axes;
    double cost = 0; ///< multiply-adds a voxel, those at nodes outside the volume included
};

/// The cheapest cascade for these standard deviations in voxels that is off by at most `truncation` along each axis;
/// none if no axis has one. `direct` are the taps of the direct convolution, for axes that do without.
std::optional<GaussianCascade> gaussian_cascade(Vec3 const& sigma, Index3 dims, Boundary boundary, double truncation,
                                                std::array<GaussianTaps, 3> const& direct);

} // namespace vkt
