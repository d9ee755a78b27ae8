// Flip: a copy whose source rows, columns or slices are taken in reverse.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/flip.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/voxels/kernels/flip.h"

namespace vkt {

VKT_OPERATION(Flip, "flip")
VKT_OPERATION(FlipRange, "flip-range")

Texts Flip::texts() const {
    return {"Reverse the order of the voxels along an axis.",
            "The direction of the axis is reversed as well, so voxels keep their world positions. With --roi only the "
            "voxels inside the region are mirrored, within it, and the geometry stays."
            "\n\n"
            "Accuracy: Exact: bytes are moved, world positions survive.",
            {{"Mirror left and right", "vkt flip x volume.nrrd -o mirrored.nrrd"},
             {"Twice is once too often", "vkt read volume.nrrd | vkt flip z | vkt flip z | vkt diff volume.nrrd -"}}};
}

void Flip::parameters(Parameters& parameters) {
    parameters.positional("axis", axis_, "axis to mirror: x, y or z").alias("axis"); // volkit says --axis
    parameters.option("roi", region_, "REGION", "mirror only the voxels of this region");
}

Box Flip::region_in(Index3 dims) const {
    Roi const region = this->region();
    return region.empty() ? box_of(dims) : region.resolve(dims);
}

Plan Flip::plan(std::span<Header const> inputs) const {
    Plan plan;
    plan.output = inputs[0];
    Box const box = region_in(inputs[0].dims);
    bool const whole = box == box_of(inputs[0].dims);
    int const axis = static_cast<int>(axis_);
    if (whole) {
        plan.output.geometry = flipped(inputs[0].geometry, axis_, inputs[0].dims[axis]);
        if (auto& part = plan.output.part)
            part->offset[axis] = part->global_dims[axis] - part->offset[axis] - inputs[0].dims[axis];
    }
    plan.access = axis_ == Axis::z && box.dims().z > 1 ? Access::random : Access::forward;
    plan.method = "mirrored copy";
    plan.passing = ErrorPassing::moved(values_of(inputs[0]));
    plan.cost = 0;
    return plan;
}

void Flip::begin(std::span<Header const> inputs, Plan const&) { box_ = region_in(inputs[0].dims); }

std::optional<BrickSequence> Flip::move_bricks(BrickSequence input, Execution const& execution) {
    if (!(box_ == box_of(input.header().dims)))
        throw Error(ErrorKind::usage, "a part of a hierarchical volume cannot be mirrored: bricks would be cut",
                    "flip all of it, or make it a grid first: vkt resample --cells 50M");
    return flip_tree(std::move(input), axis_, mirrored_cells(axis_), execution);
}

MoveCells mirrored_cells(Axis axis) {
    return [axis](ConstView from, std::byte* to, Execution const& execution) {
        flip_box(from, dense_view(to, from.type, from.box, execution.space()), axis, execution);
    };
}

Box Flip::mirrored(Box part) const {
    int const axis = static_cast<int>(axis_);
    std::int64_t const sum = box_.lower[axis] + box_.upper[axis], lower = part.lower[axis];
    part.lower[axis] = sum - part.upper[axis];
    part.upper[axis] = sum - lower;
    return part;
}

Box Flip::footprint(Box const& output, int) const {
    Box const inside = intersect(output, box_);
    if (inside.empty()) return output;
    Box const source = mirrored(inside);
    if (output == inside) return source;
    // Voxels inside come from the mirrored part, those around it from where they are.
    return {{std::min(output.lower.x, source.lower.x), std::min(output.lower.y, source.lower.y),
             std::min(output.lower.z, source.lower.z)},
            {std::max(output.upper.x, source.upper.x), std::max(output.upper.y, source.upper.y),
             std::max(output.upper.z, source.upper.z)}};
}

Texts FlipRange::texts() const {
    return {"Mirror the voxels of a region within it.",
            "volkit's name for vkt flip --roi. Voxels outside the region and the geometry stay as they are."
            "\n\n"
            "Accuracy: Exact: bytes are moved, world positions survive.",
            {{"Mirror a corner left and right",
              "vkt make ramp --dims 16 12 8 | vkt flip-range --axis x --first 0 0 0 --last 4 4 4 | vkt stats"}}};
}

void FlipRange::parameters(Parameters& parameters) {
    parameters.option("axis", axis_, "AXIS", "axis to mirror: x, y or z");
    parameters.option("first", first_, "X Y Z", "first voxel of the region").needed();
    parameters.option("last", last_, "X Y Z", "the voxel just beyond the region").needed();
}

void Flip::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = intersect(out.box, box_);
    if (inside != out.box) copy_region(inputs[0].part(out.box), out, execution);
    if (!inside.empty()) flip_box(inputs[0].part(mirrored(inside)), out.part(inside), axis_, execution);
}

} // namespace vkt
