// Spline coefficients as a volume, host side: what they are made of.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/spline_coefficients.h"

#include "libvkt/core/text.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/resample/kernels/affine.h"
#include "libvkt/operations/resample/kernels/bspline.h"

#include <algorithm>

namespace vkt {

Index3 SplineRule::margins(Index3 dims) const {
    return {beyond_along(dims.x, margin, boundary), beyond_along(dims.y, margin, boundary),
            beyond_along(dims.z, margin, boundary)};
}

Box SplineRule::source(Box const& coefficients, Index3 dims) const {
    Box result;
    for (int a = 0; a < 3; ++a) {
        std::int64_t const n = dims[a], low = coefficients.lower[a] - prefilter.radius,
                           high = coefficients.upper[a] + prefilter.radius;
        std::int64_t& lower = result.lower[a];
        std::int64_t& upper = result.upper[a];
        lower = std::clamp<std::int64_t>(low, 0, n - 1);
        upper = std::clamp<std::int64_t>(high, 1, n);
        if (low >= 0 && high <= n) continue;
        if (boundary == Boundary::wrap) lower = 0, upper = n;
        if (boundary != Boundary::mirror) continue;
        if (low < 0) upper = std::max(upper, std::min(n, -low));
        if (high > n) lower = std::min(lower, std::max<std::int64_t>(0, 2 * n - high));
        if (low < -n || high > 2 * n) lower = 0, upper = n;
    }
    return result;
}

void spline_coefficients(SplineRule const& rule, std::vector<double> const& weight, Index3 dims, ConstView in,
                         AnyView out, Buffer& scratch, Execution const& execution) {
    Box const source = rule.source(out.box, dims);
    Box held = out.box;
    for (int a = 0; a < 2; ++a) {
        held.lower[a] = std::min(held.lower[a], source.lower[a]);
        held.upper[a] = std::max(held.upper[a], source.upper[a]);
    }
    SplineFilter filter;
    filter.weight = weight.data();
    filter.radius = rule.prefilter.radius;
    filter.dims = dims;
    filter.boundary = rule.boundary;
    filter.border = rule.border * rule.scale;
    filter.scale = rule.scale;
    if (held == out.box) return bspline_coefficients(in, out, out.box, source, filter, execution);
    scratch.reserve(static_cast<std::size_t>(held.voxels()) * size_of(rule.type));
    AnyView const wider = dense_view(scratch.write(execution.space()), rule.type, held, execution.space());
    bspline_coefficients(in, wider, out.box, source, filter, execution);
    copy_region(ConstView(wider).part(out.box), out, execution);
}

SplineCoefficients::SplineCoefficients(SplineRule rule)
    : rule_(std::move(rule)), weight_(rule_.prefilter.weight.begin(), rule_.prefilter.weight.end()) {}

Plan SplineCoefficients::plan(std::span<Header const> inputs) const {
    Plan plan;
    plan.output = inputs[0];
    plan.output.dtype = rule_.type;
    plan.output.values = {};
    plan.output.part.reset();
    Index3 const margins = rule_.margins(plan.output.dims);
    plan.output.dims = plan.output.dims + margins + margins;
    plan.method = text("coefficients of a spline, radius ", rule_.prefilter.radius);
    plan.cost = 3 * static_cast<double>(rule_.prefilter.radius);
    plan.slab_hint = 4 * rule_.prefilter.radius;
    if (rule_.boundary == Boundary::wrap) plan.access = Access::random; // what comes before the first slice is the last
    return plan;
}

void SplineCoefficients::begin(std::span<Header const> inputs, Plan const&) { dims_ = inputs[0].dims; }

Box SplineCoefficients::at_margin(Box const& output) const {
    Index3 const margin = rule_.margins(dims_);
    return {output.lower - margin, output.upper - margin};
}

Box SplineCoefficients::footprint(Box const& output, int) const { return rule_.source(at_margin(output), dims_); }

std::size_t SplineCoefficients::fit(Index3 largest, Execution const&) {
    std::int64_t const all = dims_.y + 2 * rule_.margins(dims_).y;
    if (largest.y >= all) return 0;
    std::int64_t const rows = std::min(largest.y + 2 * rule_.prefilter.radius, all);
    return static_cast<std::size_t>(largest.x * rows * largest.z) * size_of(rule_.type);
}

void SplineCoefficients::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    spline_coefficients(rule_, weight_, dims_, inputs[0], out.moved_to(at_margin(out.box).lower), scratch_, execution);
}

} // namespace vkt
