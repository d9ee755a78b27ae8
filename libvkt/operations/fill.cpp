// Fill: the region from a constant, the rest from the input.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/fill.h"

#include "libvkt/amr/tree.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

VKT_KERNEL(fill_box, (AnyView out, double value, Execution const& execution), (out, value, execution))

namespace VKT_BACKEND {

void fill_box(AnyView out, double value, Execution const& execution) {
    for_each_type(out.type, [&]<class T>(T) { fill(execution, out.box, out.as<T>(), round_to<T>(value)); });
}

} // namespace VKT_BACKEND

#if VKT_HOST

VKT_OPERATION(Fill, "fill")
VKT_OPERATION(FillRange, "fill-range")

void Fill::parameters(Parameters& parameters) {
    parameters.option("value", value_, "VALUE", "physical value to store");
    parameters.option("roi", region_, "REGION", "fill only the voxels of this region");
    parameters.option("first", first_, "X Y Z", "first voxel of the region (volkit)");
    parameters.option("last", last_, "X Y Z", "the voxel just beyond the region (volkit)");
}

void Fill::check() const {
    if (first_.has_value() != last_.has_value()) throw Error(ErrorKind::usage, "--first and --last go together");
    if (first_ && !region_.empty())
        throw Error(ErrorKind::usage, "--roi and --first/--last say the same: give one of them");
}

void FillRange::check() const {
    Fill::check();
    if (!first_ && region_.empty())
        throw Error(ErrorKind::usage, "no range is given", "say for example --first 0 0 0 --last 8 8 8");
}

Plan Fill::plan(std::span<Header const> inputs) {
    Plan plan;
    plan.output = inputs[0];
    if (first_) region_ = roi_of(*first_, *last_);
    box_ = region_.empty() ? box_of(inputs[0].dims) : region_.resolve(inputs[0].dims);
    finest_ = box_;
    whole_ = region_.empty();
    stored_ = inputs[0].values.stored(value_);
    type_ = inputs[0].dtype;
    plan.method = "constant";
    plan.cost = 0;
    return plan;
}

void Fill::enter_level(Index3 cell_width) { box_ = cells_centred_in(finest_, cell_width); }

void Fill::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = whole_ ? out.box : intersect(out.box, box_);
    if (!(inside == out.box)) copy_region(inputs[0].part(out.box), out, execution);
    if (!inside.empty()) fill_box(out.part(inside), stored_, execution);
}

std::vector<Remark> Fill::remarks() const {
    bool clipped = false, nan = false;
    baseline::for_each_type(type_, [&]<class T>(T) {
        clipped = baseline::is_clipped<T>(stored_);
        nan = baseline::is_lost_nan<T>(stored_);
    });
    std::string const count = text(finest_.voxels(), " voxels");
    if (nan) return {{text(type_, " has no NaN: 0 is stored in ", count), true}};
    if (!clipped) return {};
    double const held = stored_ < 0 ? lowest_of(type_) : highest_of(type_);
    return {{text("the value ", value_, " does not fit ", type_, ": stored as ", held, " in ", count), true}};
}

#endif

} // namespace vkt
