// Bilateral filter: smooths what is alike and near, and keeps edges.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/bilateral.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/filter/local_filter.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace vkt {

namespace {

/// Memory of a thread that computes with neighbours.
std::size_t stencil_bytes(DataType type, Index3 radius) {
    std::size_t const value = size_of(type) <= 2 || type == DataType::float32 ? 4 : 8;
    std::int64_t const columns = 1024 + 2 * radius.x + 2 * 16, lines = 8 + 2 * radius.y, slices = 2 * radius.z + 1;
    return static_cast<std::size_t>(columns * lines * slices) * value;
}

/// The mean of the box around each voxel, each neighbour weighted by a Gaussian of its distance and one of the
/// difference of its value (Tomasi and Manduchi 1998). The box reaches 2.5 sigma, rounded up, as in ITK, or a given
/// radius, up to 32 voxels. Every weight is computed, to the digits of float32; of 32- and 64-bit types in float64, to
/// which 64-bit integers are rounded. The type is kept. What is not finite has no weight, and stays as it is. In
/// hierarchical volumes voxels are cells of their own level.
class BilateralFilter : public LocalFilter, public Tunable {
public:
    std::string_view name() const override { return "filter bilateral"; }
    Texts texts() const override {
        return {"Smooth what is alike, and keep edges.",
                "The mean of the voxels around, weighted by a Gaussian of their distance (--sigma) and one of how far "
                "their values are from the voxel's (--range-sigma). Every weight is computed; the cost grows with the "
                "third power of --sigma. The data type is kept."
                "\n\n"
                "Accuracy: Estimate: weights are computed to 24 digits, or 53 for wide types, which changes results by "
                "some units in the last of these digits of the range of the values around.",
                {{"Noise of about 10 away, edges of 50 kept",
                  "vkt filter bilateral volume.nrrd --sigma 1 --range-sigma 20 -o calm.nrrd"},
                 {"In world units, in a region only", "vkt filter bilateral volume.nrrd --sigma 1.2 --unit world "
                                                      "--range-sigma 20 --roi 25%:75%,:,: | vkt stats"}}};
    }

    void parameters(Parameters& parameters) override {
        parameters.option("sigma", sigma_, "S", "standard deviation in space, one number or X,Y,Z");
        parameters.option("range-sigma", range_sigma_, "V", "standard deviation in values").needed();
        parameters.option("unit", unit_, "UNIT",
                          "unit of --sigma: voxel (of hierarchical volumes: finest cell) or world");
        parameters.option("radius", radius_, "R",
                          "the box reaches R voxels to either side: one number or X,Y,Z, 0 to 32 (default: 2.5 sigma)");
        LocalFilter::parameters(parameters);
    }

    void check() const override {
        LocalFilter::check();
        for (int axis = 0; axis < 3; ++axis)
            if (!std::isfinite(sigma_[axis]) || sigma_[axis] < 0)
                throw Error(ErrorKind::usage, text("--sigma ", sigma_[axis], " is not a finite number >= 0"));
        if (!std::isfinite(range_sigma_) || range_sigma_ <= 0)
            throw Error(ErrorKind::usage, text("--range-sigma ", range_sigma_, " is not a finite number above 0"),
                        "say how far values may be apart: a few times the noise");
        if (radius_) radius_->check(most_bilateral_radius);
    }

    /// How far the box reaches, in sigmas.
    std::vector<Knob> knobs() const override {
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

    std::size_t fit(Index3, Execution const& execution) override {
        if (reach_ == Index3{}) return 0;
        return stencil_bytes(type_, reach_) * static_cast<std::size_t>(std::max(1, execution.threads));
    }

    bool runs_on_gpu() const override { return true; }

protected:
    void describe(Header const& in, Index3 cell_width, Plan& plan) const override {
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

    void prepare(Header const& in, Index3 cell_width) override {
        type_ = in.dtype;
        rule_ = rule_for(in, cell_width);
        reach_ = rule_.radius;
    }

    void filter(ConstView in, AnyView out, Execution const& execution) override {
        bilateral_box(in, out, rule_, losses_, execution);
    }

private:
    BilateralRule rule_for(Header const& in, Index3 cell_width) const {
        BilateralRule rule;
        rule.range_sigma = range_sigma_ / std::abs(in.values.slope);
        Vec3 const cells = sigma_in_cells(sigma_, unit_, in, cell_width);
        for (int axis = 0; axis < 3; ++axis) {
            double const sigma = cells[axis];
            double const reach = sigma > 0 ? std::ceil(2.5 * sigma) : 0;
            if (!radius_ && !(reach <= most_bilateral_radius))
                throw Error(
                    ErrorKind::usage,
                    text("--sigma of ", sigma, " voxels reaches further than ", most_bilateral_radius, " voxels"),
                    "say --radius to cut it off, or halve the resolution first: vkt resample --scale 0.5");
            rule.sigma[axis] = sigma;
            rule.radius[axis] = sigma > 0 ? radius_ ? radius_->voxels[axis] : static_cast<std::int64_t>(reach) : 0;
        }
        rule.radius = without_copies(in, rule.radius); // their weights would be the same
        return rule;
    }

    Vec3 sigma_{1, 1, 1};
    double range_sigma_ = 0;
    LengthUnit unit_ = LengthUnit::voxel;
    std::optional<Radius> radius_;
    BilateralRule rule_;
    DataType type_ = DataType::uint8;
};

} // namespace

VKT_OPERATION(BilateralFilter, "filter bilateral")

} // namespace vkt
