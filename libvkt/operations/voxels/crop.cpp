// Crop: finding the box; the engine hands the voxels through.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/crop.h"

#include "libvkt/amr/edit.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/affine.h"
#include "libvkt/core/frame.h"
#include "libvkt/formats/format.h"
#include "libvkt/kernel/border.h"

#include <cmath>

namespace vkt {
namespace {

/// Voxels whose centres lie between the outer faces of another lattice; centres within 1e-6 voxels of a face are on it,
/// and belong to what lies behind a lower face.
Box voxels_between_faces(Geometry const& geometry, Index3 dims, Geometry const& other, Index3 other_dims) {
    Affine const map = index_to_index(geometry, other);
    Vec3 lower, upper;
    for (int axis = 0; axis < 3; ++axis) {
        double const slack = 1e-6 * std::max({std::abs(map.column[0][axis]), std::abs(map.column[1][axis]),
                                              std::abs(map.column[2][axis])});
        lower[axis] = -0.5 - slack;
        upper[axis] = static_cast<double>(other_dims[axis]) - 0.5 - slack;
    }
    return voxels_within(map, lower, upper, dims);
}

} // namespace

VKT_OPERATION(Crop, "crop")

Texts Crop::texts() const {
    return {"Keep an axis-aligned box of the volume.",
            "The box is half-open and given in voxels (--roi), in world units (--roi-world), or by another volume "
            "(--like); voxels keep their world positions. Reading from a raw file touches only the bytes of the box."
            "\n\n"
            "Accuracy: Exact: bytes are moved, world positions survive.",
            {{"The central half of every axis", "vkt crop volume.nrrd --roi 25%:75%,25%:75%,25%:75% -o part.nrrd"},
             {"Ten slices from slice 20 on", "vkt crop volume.nrrd --roi :,:,20:+10 | vkt info"}}};
}

void Crop::parameters(Parameters& parameters) {
    parameters.option("roi", region_, "REGION", "voxels to keep, X0:X1,Y0:Y1,Z0:Z1; X0:X1:S is every S-th");
    parameters.option("roi-world", world_, "REGION", "the same in world units; voxels with centres inside are kept");
    parameters.option("like", like_.file, "FILE", "keep what lies within the extent of this volume");
}

void Crop::check() const {
    int const given = (region_.empty() ? 0 : 1) + (world_.empty() ? 0 : 1) + (like_.file.empty() ? 0 : 1);
    if (given == 1) return;
    throw Error(ErrorKind::usage, given == 0 ? "no region given" : "more than one region given",
                "use one of --roi X0:X1,Y0:Y1,Z0:Z1, --roi-world, --like FILE");
}

/// The region in voxels, or in finest cells.
SteppedBox Crop::wanted(Header const& in) const {
    bool const tree = in.kind == Kind::hierarchical;
    if (!like_.file.empty()) {
        Header const& like = like_.header();
        Box box = voxels_between_faces(in.geometry, in.dims, geometry_beside(in, like), like.dims);
        if (tree) box = intersect(box, region_of(in));
        if (box.empty())
            throw Error(ErrorKind::usage, text("the volume does not overlap ", like_.file),
                        "compare the extents with 'vkt info'");
        return {box};
    }
    if (!tree)
        return world_.empty() ? region_.resolve_steps(in.dims) : SteppedBox{world_.resolve(in.geometry, in.dims)};
    Box const box = world_.empty() ? resolve_in_tree(region_, in) : resolve_in_tree(world_, in);
    require_in_region(box, in); // as where the bricks are cut
    return {box};
}

Plan Crop::plan(std::span<Header const> inputs) const {
    Header const& in = inputs[0];
    SteppedBox const box = wanted(in);
    Plan plan;
    plan.output = in;
    plan.method = "copy";
    plan.passing = ErrorPassing::moved(in.error.values);
    plan.cost = 0;
    if (in.kind == Kind::hierarchical) { // bricks are kept whole, the grid stays
        plan.output.attributes["roi"] = to_text(box.box);
        return plan;
    }
    plan.output.dims = box.dims();
    plan.output.geometry = box.geometry(in.geometry);
    if (!box.dense()) {
        plan.output.part.reset(); // of another lattice
        plan.method = "copy of every n-th voxel";
        return plan;
    }
    // Still the same place in the whole; what a halo was is not known after the cut.
    if (auto& part = plan.output.part) {
        part->offset = part->offset + box.box.lower;
        if (!(box.box == box_of(in.dims))) part->halo = {};
    }
    plan.shift = box.box.lower;
    return plan;
}

void Crop::begin(std::span<Header const> inputs, Plan const&) { box_ = wanted(inputs[0]); }

Box Crop::footprint(Box const& output, int) const { return box_.source(output); }

std::optional<BrickSequence> Crop::move_bricks(BrickSequence input, Execution const& execution) {
    return crop_tree(std::move(input), box_.box, execution.space());
}

void Crop::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const in = inputs[0].part(footprint(out.box, 0));
    if (box_.dense()) return copy_region(in, out, execution);
    copy_every(in, box_.step, out);
}

} // namespace vkt
