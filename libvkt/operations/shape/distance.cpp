// Distance: rows from their runs, columns and lines along z by the kernel.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/distance.h"

#include "libvkt/core/products.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/text.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/common/zero.h"
#include "libvkt/operations/shape/kernels/distance.h"
#include "libvkt/operations/voxels/kernels/fill.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace vkt {
namespace {

/// Whole numbers of a common unit that spacings are to 12 digits, so that squared distances stay below no_site.
struct WholeSpacing {
    std::array<std::int64_t, 3> steps;
    double unit;
};

std::optional<WholeSpacing> whole_spacing(Vec3 spacing, Index3 dims) {
    double const least = std::min({spacing.x, spacing.y, spacing.z});
    constexpr std::int64_t largest = 1 << 12;
    for (std::int64_t divisor = 1; divisor <= largest; ++divisor) {
        WholeSpacing result{{}, least / static_cast<double>(divisor)};
        double farthest = 0, error = 0;
        for (int axis = 0; axis < 3; ++axis) {
            double const exact = spacing[axis] / least * static_cast<double>(divisor), nearest = std::nearbyint(exact);
            if (nearest > largest) return std::nullopt; // and all larger divisors
            error = std::max(error, std::abs(exact - nearest) / exact);
            result.steps[static_cast<std::size_t>(axis)] = static_cast<std::int64_t>(nearest);
            farthest += std::pow(nearest * static_cast<double>(dims[axis]), 2);
        }
        if (farthest >= no_site) return std::nullopt;
        if (error < 1e-12) return result;
    }
    return std::nullopt;
}

/// What a thread holds of the lines that it works on: themselves and their results, of one side or both.
std::size_t bytes_of_thread(Index3 dims, bool whole, bool both) {
    std::int64_t const longest = std::max(dims.y, dims.z);
    return static_cast<std::size_t>(longest + 40) * (distance_lanes * (whole ? 4 : 8) * (both ? 4 : 2) + 16);
}

} // namespace

VKT_OPERATION(Distance, "distance")

Texts Distance::texts() const {
    return {
        "Measure the distance to the nearest zero voxel.",
        "Exact Euclidean distances, in world units, from the centre of every non-zero voxel to the centre of the "
        "nearest one that is zero or NaN; float32. Outside of the volume there is nothing to measure to. What --memory "
        "has no room for is worked on line by line in a spool of 4 bytes a voxel."
        "\n\n"
        "Accuracy: Within 2^-23 of the value; correctly rounded where squared distances are whole numbers of a "
        "common unit, as with equal spacings.",
        {{"How deep voxels lie inside of the object", "vkt distance volume.nrrd -o depth.nrrd"},
         {"Inside positive, outside negative, in voxels",
          "vkt distance volume.nrrd --signed --unit voxel | vkt stats"}}};
}

void Distance::parameters(Parameters& parameters) {
    parameters.flag("signed", both, "zero voxels get minus the distance to the nearest non-zero one");
    parameters.option("unit", unit, "UNIT", "unit of the distances: world or voxel, whatever its shape");
    parameters.option("roi", roi, "REGION", "measure only within this region, as if there were no other voxels");
}

Distance::Steps Distance::steps_in(Header const& in) const {
    Vec3 const spacing = spacing_in(in);
    Steps steps;
    if (auto const whole = whole_spacing(spacing, roi.resolve(in.dims).dims())) {
        steps.unit = whole->unit;
        for (std::size_t a = 0; a < 3; ++a) steps.weights[a] = static_cast<double>(whole->steps[a] * whole->steps[a]);
        return steps;
    }
    steps.whole = false;
    // Relative to the largest, so that squares neither overflow nor vanish.
    steps.unit = std::max({spacing.x, spacing.y, spacing.z});
    for (int a = 0; a < 3; ++a) steps.weights[static_cast<std::size_t>(a)] = std::pow(spacing[a] / steps.unit, 2);
    return steps;
}

Plan Distance::plan(std::span<Header const> inputs) const {
    Header const& in = inputs[0];
    Plan plan;
    plan.output = in;
    plan.output.dtype = DataType::float32;
    plan.output.values = {};
    plan.output.units.clear();
    plan.output.attributes.erase("background");
    plan.whole = true;
    plan.cost = both ? 540 : 300;
    if (in.kind == Kind::hierarchical) return plan; // refused by the engine
    Index3 const dims = roi.resolve(in.dims).dims();
    bool const world = unit == LengthUnit::world;
    auto const& direction = in.geometry.direction;
    for (int a = 0; a < 3 && world; ++a)
        if (std::abs(dot(direction[static_cast<std::size_t>(a)], direction[static_cast<std::size_t>((a + 1) % 3)])) >
            1e-6)
            throw Error(ErrorKind::usage, "distances in the world need axes that are perpendicular",
                        "measure with --unit voxel, or resample the volume first: vkt resample --like");
    Vec3 const spacing = spacing_in(in);
    Steps const steps = steps_in(in);
    Vec3 size;
    for (int a = 0; a < 3; ++a) size[a] = spacing[a] * static_cast<double>(dims[a] - 1);
    plan.method = text("outward search to 20 voxels, then envelopes; squares ", steps.whole ? "exact" : "in float64");
    if (!steps.whole || steps.unit != 1) {
        plan.error.kind = ErrorBound::Kind::bound;
        plan.error.absolute = std::sqrt(dot(size, size)) * (steps.whole ? 0x1.0001p-24 : 0x1p-23);
    }
    plan.passing = ErrorPassing::jumps(ValueInterval{0, std::sqrt(dot(size, size))});
    plan.passing.storing = ErrorPassing::Storing::computes;
    plan.state_bytes = bytes_of_thread(dims, steps.whole, both) + 65536;
    return plan;
}

void Distance::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs[0];
    nan_ = objects_ = 0;
    zero_ = stored_zero(input_);
    if (input_.kind == Kind::hierarchical) return;
    region_ = roi.resolve(input_.dims);
    steps_ = steps_in(input_);
}

bool Distance::runs_on_gpu() const {
    Index3 const n = region_.dims();
    return n.x <= 500000 && std::max(n.y, n.z) <= (steps_.whole ? 36000 : 22000);
}

Box Distance::footprint(Box const&, int) const { return region_; }

std::size_t Distance::fit(Index3, Execution const& execution) {
    return static_cast<std::size_t>(std::max(0, execution.threads - 1)) *
           bytes_of_thread(region_.dims(), steps_.whole, both);
}

std::int64_t Distance::lines_together() const { return distance_lanes; }

void Distance::pass_x(ConstView in, AnyView out, Execution const& execution) {
    Box const inside = intersect(out.box, region_);
    if (inside != out.box) fill_box(out, VoxelBytes{}, execution);
    if (inside.empty()) return;
    DistanceRows rows;
    rows.zero = zero_;
    rows.whole = steps_.whole;
    rows.both_sides = both;
    rows.weight = steps_.weights[0];
    distance_rows(in.part(inside).moved_to({}), out.part(inside).moved_to({}), rows, execution);
    nan_ += rows.nan;
    objects_ += rows.objects;
}

void Distance::pass(Axis axis, AnyView lines, Execution const& execution) {
    DistancePass pass;
    pass.axis = axis;
    pass.whole = steps_.whole;
    pass.both_sides = both;
    if (axis == Axis::y) {
        pass.weight = steps_.weights[1];
        pass.weight_before = steps_.whole ? 0 : steps_.weights[0];
    } else {
        pass.weight = steps_.weights[2];
        pass.unit = steps_.unit;
    }
    distance_pass(lines.moved_to({}), pass, execution);
}

void Distance::run(std::span<ConstView const> inputs, AnyView whole, Execution const& execution) {
    std::optional<ProgressPart> share(std::in_place, execution.monitor, 0.0, 0.2);
    pass_x(inputs[0], whole, execution);
    AnyView const lines = whole.part(region_);
    share.emplace(execution.monitor, 0.2, 0.4);
    pass(Axis::y, lines, execution);
    share.emplace(execution.monitor, 0.6, 0.4);
    pass(Axis::z, lines, execution);
}

std::vector<Remark> Distance::remarks() const {
    std::vector<Remark> result;
    if (nan_ > 0) result.push_back({text(share_text(nan_, region_.voxels()), " not a number: taken for zero"), false});
    bool const none = objects_ == region_.voxels() || (both && objects_ == 0);
    if (none) result.push_back({"all voxels are of one kind: distances are infinite", false});
    return result;
}

} // namespace vkt
