// Copy: a volume pasted into another.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/paste.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/losses.h"
#include "libvkt/engine/operation.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/beside.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/common/remarks.h"

#include <cmath>

namespace vkt {

namespace {

/// The voxel of `into` at which the first voxel of `part` lies, if both lattices have the same spacing and directions.
Index3 place_in_world(Header const& part, Header const& into) {
    Geometry here = geometry_beside(into, part);
    Vec3 const index = world_to_index(into.geometry, here.origin);
    Index3 result;
    Vec3 whole;
    for (int axis = 0; axis < 3; ++axis) {
        whole[axis] = std::floor(index[axis] + 0.5);
        if (!(std::abs(whole[axis]) < 0x1p40)) throw Error(ErrorKind::usage, "the part lies far outside of the volume");
        result[axis] = static_cast<std::int64_t>(whole[axis]);
    }
    Geometry expected = into.geometry;
    expected.origin = index_to_world(into.geometry, whole);
    if (!same_geometry(here, expected))
        throw Error(ErrorKind::usage,
                    "the part does not lie on the voxels of the volume, by origin, spacing and direction",
                    "say where it goes: --at X,Y,Z; or put it onto the volume's grid with 'vkt resample --like'");
    return result;
}

/// The second volume with the voxels of the first in place of its own, from voxel `at` on; without it where the first
/// lies in the world, which must be on the second's lattice. Bytes are moved if type and value map agree; else values
/// are converted: rounded half to even, saturated, counted; with other value maps by way of physical values in float64.
class Paste : public Operation {
public:
    std::string part, into = "-"; ///< paths
    std::optional<Index3> at;

    std::string_view name() const override { return "copy"; }
    Texts texts() const override {
        return {"Paste a volume into another.",
                "The second volume, with the voxels of the first in place of its own. Without --at the part goes where "
                "it lies in the world: back to where vkt crop took it from."
                "\n\n"
                "Accuracy: Exact: bytes are moved. Where types or value maps differ values are converted, in double "
                "precision (estimate).",
                {{"A part smoothed, and put back", "vkt crop volume.nrrd --roi 8:24,8:24,: | vkt filter gaussian "
                                                   "--sigma 1 | vkt copy - volume.nrrd -o partly.nrrd"},
                 {"A label in a corner", "vkt make constant --dims 4 4 4 --dtype uint8 --value 9 -o label.nrrd && vkt "
                                         "read volume.nrrd | vkt copy label.nrrd --at 0,0,0 | vkt stats"}}};
    }

    Shape shape() const override { return Shape::geometric; }
    int inputs() const override { return 2; }
    std::vector<std::string> input_names() const override { return {part.empty() ? "-" : part, into}; }
    void parameters(Parameters& parameters) override {
        parameters.positional("part", part, "the volume to paste: a file, or '-' for standard input");
        parameters.positional("into", into, "the volume to paste it into (default: standard input)").optional();
        parameters.option("at", at, "X Y Z", "voxel where the part begins (default: where it lies in the world)");
    }

    /// Throws Error{usage} if the part does not lie in the volume.
    Plan plan(std::span<Header const> inputs) const override {
        Header const &pasted = inputs[0], &whole = inputs[1];
        static_cast<void>(place_of(pasted, whole)); // or it is refused
        Plan plan;
        plan.output = whole;
        plan.method = "copy";
        plan.cost = 0;
        auto values = values_of(pasted);
        auto const around = values_of(whole);
        plan.passing = ErrorPassing::moved(values && around ? std::optional(values->with(*around)) : std::nullopt);
        plan.passing.storing = ErrorPassing::Storing::converts;
        plan.passing.passed = std::max(pasted.error.at_most, whole.error.at_most);
        if (!(pasted.values == whole.values)) {
            plan.method = "copy, values mapped";
            plan.passing.storing = ErrorPassing::Storing::computes;
            plan.error.kind = ErrorBound::Kind::estimate;
            plan.error.magnitude = 1e-15 + storing_error(whole.dtype);
        }
        return plan;
    }

    void begin(std::span<Header const> inputs, Plan const&) override {
        part_ = inputs[0];
        into_ = inputs[1];
        box_ = place_of(part_, into_);
        counts_ = {};
    }

    Box footprint(Box const& output, int input) const override {
        Box const inside = intersect(output, box_);
        if (input == 1) return inside == output ? Box{} : output;
        return inside.empty() ? Box{} : Box{inside.lower - box_.lower, inside.upper - box_.lower};
    }

    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override {
        Box const inside = intersect(out.box, box_);
        for_each_beside(out.box, inside,
                        [&](Box const& box) { copy_region(inputs[1].part(box), out.part(box), execution); });
        if (inside.empty()) return;
        AnyView const to = out.part(inside);
        ConstView const from = inputs[0].part(footprint(inside, 0)).moved_to(inside.lower);
        if (!(part_.values == into_.values))
            return paste_mapped(from, to, part_.values, into_.values, counts_, execution);
        if (part_.dtype == into_.dtype) return copy_region(from, to, execution);
        convert_values(from, to, counts_, execution);
    }

    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return counts_.counters(); }
    std::vector<Remark> remarks() const override { return store_remarks(counts_, part_.voxels(), into_.dtype); }

private:
    /// Where the part goes.
    Box place_of(Header const& pasted, Header const& whole) const {
        if (pasted.kind != whole.kind)
            throw Error(ErrorKind::usage, "one of the volumes is hierarchical",
                        "make it a grid first: vkt resample --cells 50M");
        Index3 const lower = at ? *at : place_in_world(pasted, whole);
        Box const box{lower, lower + pasted.dims};
        if (!box_of(whole.dims).contains(box))
            throw Error(
                ErrorKind::usage,
                text("the part of ", pasted.dims, " voxels at ", lower, " does not lie in the volume of ", whole.dims),
                "cut it with 'vkt crop', or enlarge the volume with 'vkt pad'");
        return box;
    }

    Header part_, into_;
    Box box_; ///< where the part goes
    Losses counts_;
};

} // namespace

VKT_OPERATION(Paste, "copy")

} // namespace vkt
