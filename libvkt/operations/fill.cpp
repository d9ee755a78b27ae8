// Fill: the region from a constant, the rest from the input.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/fill.h"

#include "libvkt/amr/tree.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/kernels/fill.h"

#include <cmath>

namespace vkt {

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
    filled_ = 0;
    whole_ = region_.empty();
    stored_ = inputs[0].values == ValueMap{} ? value_ : Number(inputs[0].values.stored(value_.value));
    type_ = inputs[0].dtype;
    plan.method = "constant";
    plan.cost = 0;
    return plan;
}

void Fill::enter_level(Index3 cell_width, Index3 first) {
    box_ = cells_centred_in({finest_.lower - first, finest_.upper - first}, cell_width);
}

void Fill::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = whole_ ? out.box : intersect(out.box, box_);
    if (!(inside == out.box)) copy_region(inputs[0].part(out.box), out, execution);
    filled_ += inside.voxels();
    if (!inside.empty()) fill_box(out.part(inside), voxel_bytes(type_, stored_), execution);
}

std::vector<Remark> Fill::remarks() const {
    std::string const count = text(filled_, " voxels");
    if (is_integer(type_) && std::isnan(stored_.value))
        return {{text(type_, " has no NaN: 0 is stored in ", count), true}};
    if (filled_ == 0 || fits(type_, stored_)) return {};
    bool const low = stored_.value < 0;
    double const held = !is_integer(type_) ? std::copysign(HUGE_VAL, stored_.value)
                        : low              ? lowest_of(type_)
                                           : highest_of(type_);
    return {{text("the value ", value_, " does not fit ", type_, ": stored as ", held, " in ", count), true}};
}

} // namespace vkt
