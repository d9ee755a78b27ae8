// Crop: finding the box; the engine hands the voxels through.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/crop.h"

#include "libvkt/amr/edit.h"
#include "libvkt/formats/format.h"
#include "libvkt/kernel/border.h"

#if VKT_HOST

#include <array>
#include <cmath>
#include <limits>

namespace vkt {
namespace {

/// Index-space bounds of the eight corners that `corner(low or high per axis)` gives in the world.
template <class Corner> std::array<Vec3, 2> index_bounds(Geometry const& geometry, Corner const& corner) {
    double const inf = std::numeric_limits<double>::infinity();
    std::array<Vec3, 2> bounds{{{inf, inf, inf}, {-inf, -inf, -inf}}};
    for (int i = 0; i < 8; ++i) {
        Vec3 const index = world_to_index(geometry, corner((i & 1) != 0, (i & 2) != 0, (i & 4) != 0));
        for (int axis = 0; axis < 3; ++axis) {
            bounds[0][axis] = std::min(bounds[0][axis], index[axis]);
            bounds[1][axis] = std::max(bounds[1][axis], index[axis]);
        }
    }
    return bounds;
}

/// Voxels with centres in [lower, upper), cut to the volume; bounds within 1e-6 voxels of a centre count as on it.
Box voxels_between(std::array<Vec3, 2> const& bounds, Index3 dims) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        double const n = static_cast<double>(dims[axis]);
        box.lower[axis] = static_cast<std::int64_t>(std::clamp(std::ceil(bounds[0][axis] - 1e-6), 0.0, n));
        box.upper[axis] = static_cast<std::int64_t>(std::clamp(std::ceil(bounds[1][axis] - 1e-6), 0.0, n));
    }
    return box;
}

} // namespace

VKT_OPERATION(Crop, "crop")

void Crop::parameters(Parameters& parameters) {
    parameters.option("roi", region_, "REGION", "voxels to keep, X0:X1,Y0:Y1,Z0:Z1");
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
Box Crop::wanted(Header const& in) {
    if (!like_.file.empty()) {
        Geometry const& g = like_.header().geometry;
        Index3 const n = like_.header().dims;
        Box const box =
            voxels_between(index_bounds(in.geometry,
                                        [&](bool x, bool y, bool z) {
                                            return index_to_world(g, {x ? static_cast<double>(n.x) - 0.5 : -0.5,
                                                                      y ? static_cast<double>(n.y) - 0.5 : -0.5,
                                                                      z ? static_cast<double>(n.z) - 0.5 : -0.5});
                                        }),
                           in.dims);
        if (box.empty())
            throw Error(ErrorKind::usage, text("the volume does not overlap ", like_.file),
                        "compare the extents with 'vkt info'");
        return box;
    }
    return world_.empty() ? region_.resolve(in.dims) : world_.resolve(in.geometry, in.dims);
}

Plan Crop::plan(std::span<Header const> inputs) {
    Header const& in = inputs[0];
    box_ = wanted(in);
    Plan plan;
    plan.output = in;
    plan.method = "copy";
    plan.cost = 0;
    if (in.kind == Kind::hierarchical) { // bricks are kept whole, the grid stays
        plan.output.attributes["roi"] = to_text(box_);
        return plan;
    }
    plan.output.dims = box_.dims();
    plan.output.geometry = cropped(in.geometry, box_.lower);
    // Still the same place in the whole; what a halo was is not known after the cut.
    if (auto& part = plan.output.part) {
        part->offset = part->offset + box_.lower;
        if (!(box_ == box_of(in.dims))) part->halo = {};
    }
    plan.shift = box_.lower;
    return plan;
}

Box Crop::footprint(Box const& output, int) const { return {output.lower + box_.lower, output.upper + box_.lower}; }

bool Crop::run_tree(Volume const& input, Volume& output, Execution const& execution) {
    output = crop_tree(input, box_, execution);
    return true;
}

void Crop::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    copy_region(inputs[0].part(footprint(out.box, 0)), out, execution);
}

} // namespace vkt

#endif
