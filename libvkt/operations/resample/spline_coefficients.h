// The coefficients of the spline through a volume, computed once for an operation that looks at them anywhere.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/resample/spline.h"

#include <vector>

namespace vkt {

/// What SplineCoefficients computes.
struct SplineRule {
    SplinePrefilter prefilter;
    DataType type = DataType::float32; ///< of the coefficients, or float64
    Boundary boundary = Boundary::clamp;
    double border = 0;       ///< stored value, for Boundary::border
    std::int64_t margin = 0; ///< voxels beyond the faces that have coefficients too
    double scale = 1;        ///< coefficients are those of voxels times this power of two

    /// The margin of a volume of these extents: none along axes of one voxel that is continued as it is.
    Index3 margins(Index3 dims) const;
    /// The voxels that coefficients in a box of a volume are made of; the box may reach outside.
    Box source(Box const& coefficients, Index3 dims) const;
};

/// The volume becomes one of coefficients, larger by the margins on all sides: voxel (0,0,0) is the coefficient at
/// -margins. No operation that users name: see Prepared.
class SplineCoefficients : public Operation {
public:
    explicit SplineCoefficients(SplineRule rule);

    std::string_view name() const override { return "spline coefficients"; }
    Shape shape() const override { return Shape::neighbourhood; }
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }

private:
    Box at_margin(Box const& output) const;

    SplineRule rule_;
    std::vector<double> weight_;
    Index3 dims_;
    Buffer scratch_;
};

/// Computes the coefficients of out.box, which may reach outside a volume of these extents, from `in`, which covers
/// rule.source() of it. `scratch` grows to what that takes.
void spline_coefficients(SplineRule const& rule, std::vector<double> const& weight, Index3 dims, ConstView in,
                         AnyView out, Buffer& scratch, Execution const& execution);

} // namespace vkt
