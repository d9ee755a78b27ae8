// Bilateral filter, host side: window, units and cost.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/bilateral.h"

#include "libvkt/engine/travelled.h"

#include <algorithm>
#include <cmath>

namespace vkt {

VKT_OPERATION(BilateralFilter, "filter bilateral")

std::size_t stencil_bytes(DataType type, Index3 radius) {
    std::size_t const value = size_of(type) <= 2 || type == DataType::float32 ? 4 : 8;
    std::int64_t const columns = 1024 + 2 * radius.x + 2 * 16, lines = 8 + 2 * radius.y, slices = 2 * radius.z + 1;
    return static_cast<std::size_t>(columns * lines * slices) * value;
}

Texts BilateralFilter::texts() const {
    return {"Smooth what is alike, and keep edges.",
            "The mean of the voxels around, weighted by a Gaussian of their distance (--sigma) and one of how far "
            "their values are from the voxel's (--range-sigma). Every weight is computed; the cost grows with the "
            "third power of --sigma. The data type is kept."
            "\n\n"
            "Accuracy: Estimate: weights are computed to 24 digits, or 53 for wide types, which changes results by "
            "some units in the last of these digits of the range of the values around.",
            {{"Noise of about 10 away, edges of 50 kept",
              "vkt filter bilateral volume.nrrd --sigma 1 --range-sigma 20 -o calm.nrrd"},
             {"In world units, in a region only",
              "vkt filter bilateral volume.nrrd --sigma 1.2 --unit world --range-sigma 20 --roi 25%:75%,:,: | vkt "
              "stats"}}};
}

void BilateralFilter::parameters(Parameters& parameters) {
    parameters.option("sigma", sigma_, "S", "standard deviation in space, one number or X,Y,Z");
    parameters.option("range-sigma", range_sigma_, "V", "standard deviation in values").needed();
    parameters.option("unit", unit_, "UNIT", "unit of --sigma: voxel (of hierarchical volumes: finest cell) or world");
    parameters.option("radius", radius_, "R",
                      "the box reaches R voxels to either side: one number or X,Y,Z, 0 to 32 (default: 2.5 sigma)");
    LocalFilter::parameters(parameters);
}

void BilateralFilter::check() const {
    LocalFilter::check();
    for (int axis = 0; axis < 3; ++axis)
        if (!std::isfinite(sigma_[axis]) || sigma_[axis] < 0)
            throw Error(ErrorKind::usage, text("--sigma ", sigma_[axis], " is not a finite number >= 0"));
    if (!std::isfinite(range_sigma_) || range_sigma_ <= 0)
        throw Error(ErrorKind::usage, text("--range-sigma ", range_sigma_, " is not a finite number above 0"),
                    "say how far values may be apart: a few times the noise");
    if (radius_) radius_->check(most_bilateral_radius);
}

std::vector<Knob> BilateralFilter::knobs() const {
    if (reach_ == Index3{}) return {};
    auto const reaching = [&](double sigmas) {
        Radius radius{{0, 0, 0}};
        for (int axis = 0; axis < 3; ++axis)
            radius.voxels[axis] = static_cast<std::int64_t>(
                std::min(static_cast<double>(most_bilateral_radius), std::ceil(sigmas * rule_.sigma[axis])));
        return ValueText<Radius>::write(radius).front();
    };
    std::vector<std::string> values;
    for (double const sigmas : {1.0, 1.5, 2.0, 2.5, 3.0, 4.0})
        if (values.empty() || reaching(sigmas) != values.back()) values.push_back(reaching(sigmas));
    return {{"radius", values, reaching(5), false}};
}

BilateralRule BilateralFilter::rule_for(Header const& in, Index3 cell_width) const {
    BilateralRule rule;
    rule.range_sigma = range_sigma_ / std::abs(in.values.slope);
    Vec3 const cells = sigma_in_cells(sigma_, unit_, in, cell_width);
    for (int axis = 0; axis < 3; ++axis) {
        double const sigma = cells[axis];
        double const reach = sigma > 0 ? std::ceil(2.5 * sigma) : 0;
        if (!radius_ && !(reach <= most_bilateral_radius))
            throw Error(ErrorKind::usage,
                        text("--sigma of ", sigma, " voxels reaches further than ", most_bilateral_radius, " voxels"),
                        "say --radius to cut it off, or halve the resolution first: vkt resample --scale 0.5");
        rule.sigma[axis] = sigma;
        rule.radius[axis] = sigma > 0 ? radius_ ? radius_->voxels[axis] : static_cast<std::int64_t>(reach) : 0;
    }
    rule.radius = without_copies(in, rule.radius); // their weights would be the same
    return rule;
}

void BilateralFilter::describe(Header const& in, Index3 cell_width, Plan& plan) const {
    require_border_voxel(in);
    Index3 const radius = rule_for(in, cell_width).radius;
    plan.passing = ErrorPassing::averaged(1, values_read(in, plan));
    plan.passing.gain = {HUGE_VAL};
    plan.passing.because = "its weights follow the values";
    if (radius == Index3{}) {
        plan.passing = {}; // that of a copy
        plan.shift = Index3{};
        plan.method = "copy";
        plan.cost = 0;
        return;
    }
    Index3 const edges = radius + radius + Index3{1, 1, 1};
    plan.method = text("bilateral, every weight of ", edges.x, "x", edges.y, "x", edges.z);
    plan.cost = 8 * static_cast<double>(edges.x) * static_cast<double>(edges.y) * static_cast<double>(edges.z);
    plan.slab_hint = std::max<std::int64_t>(8, 4 * radius.z);
    bool const narrow = size_of(in.dtype) <= 2 || in.dtype == DataType::float32;
    plan.error.kind = ErrorBound::Kind::estimate;
    plan.error.range = static_cast<double>(edges.x + edges.y + edges.z + 16) * (narrow ? 0x1p-24 : 0x1p-53);
    plan.error.magnitude = storing_error(in.dtype) + (narrow ? 0x1p-24 : 0x1p-53);
    plan.error.absolute = std::abs(in.values.slope) * storing_floor(in.dtype);
}

void BilateralFilter::prepare(Header const& in, Index3 cell_width) {
    type_ = in.dtype;
    rule_ = rule_for(in, cell_width);
    reach_ = rule_.radius;
}

std::size_t BilateralFilter::fit(Index3, Execution const& execution) {
    if (reach_ == Index3{}) return 0;
    return stencil_bytes(type_, reach_) * static_cast<std::size_t>(std::max(1, execution.threads));
}

void BilateralFilter::filter(ConstView in, AnyView out, Execution const& execution) {
    bilateral_box(in, out, rule_, losses_, execution);
}

} // namespace vkt
