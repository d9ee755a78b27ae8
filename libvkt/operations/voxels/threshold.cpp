// Threshold: which values are inside.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/threshold.h"

#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/tree.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/voxels/kernels/fill.h"

namespace vkt {

VKT_OPERATION(Threshold, "threshold")

Texts Threshold::texts() const {
    return {
        "Make a mask: 1 where the value lies in a range, 0 elsewhere.",
        "The result is uint8. --above and --below leave out the number itself, --range takes both of its ends. --otsu "
        "finds the threshold that separates the values best and keeps what is above it; --report tells which. Values "
        "are physical; NaN is 0."
        "\n\n"
        "Accuracy: Exact: values are compared as they are, integers of 64 bits too.",
        {{"Bone in a CT", "vkt threshold volume.nrrd --above 100 -o bone.nrrd"},
         {"One label", "vkt threshold volume.nrrd --range 3:3 | vkt stats"},
         {"Foreground, and the threshold that was found",
          "vkt threshold volume.nrrd --otsu --report threshold.json -o mask.nrrd"}}};
}

void Threshold::parameters(Parameters& p) {
    p.option("above", above, "T", "1 where the value is greater than T");
    p.option("below", below, "T", "1 where the value is less than T; with --above, between the two");
    p.option("range", range, "LO:HI", "1 where LO <= value <= HI; an end may be left out");
    p.flag("otsu", otsu, "1 above the threshold that separates the values best (Otsu's)");
    p.option("roi", roi, "REGION", "look only at the voxels of this region; the others become 0");
}

void Threshold::check() const {
    if ((above || below ? 1 : 0) + (range ? 1 : 0) + (otsu ? 1 : 0) != 1)
        throw Error(ErrorKind::usage, "one way to choose the values is needed",
                    "say --above T, --below T, both of them, --range LO:HI or --otsu");
    for (auto const& [name, t] : {std::pair{"above", above}, std::pair{"below", below}})
        if (t && !std::isfinite(t->value))
            throw Error(ErrorKind::usage, text("--", name, ": ", t->value, " is not a finite number"));
    if (above && below &&
        !(above->value < below->value || (above->whole && below->whole && *above->whole < *below->whole)))
        throw Error(ErrorKind::usage, text("nothing is above ", *above, " and below ", *below));
}

Box Threshold::region_in(Header const& in) const {
    bool const tree = in.kind == Kind::hierarchical;
    return roi.empty() ? (tree ? region_of(in) : box_of(in.dims))
           : tree      ? resolve_in_tree(roi, in)
                       : roi.resolve(in.dims);
}

Plan Threshold::plan(std::span<Header const> inputs) const {
    Header const& in = inputs.front();
    static_cast<void>(region_in(in)); // or it is refused
    Plan plan;
    plan.output = in;
    plan.output.dtype = DataType::uint8;
    plan.output.values = {};
    plan.output.units.clear();
    plan.passing = ErrorPassing::jumps(ValueInterval{0, 1});
    plan.method = otsu ? "histogram first, then comparison" : "comparison";
    plan.scans = otsu;
    if (otsu) plan.cost = size_of(in.dtype) <= 2 ? 40 : 140;
    if (otsu) plan.state_bytes = Otsu::state_bytes;
    return plan;
}

void Threshold::begin(std::span<Header const> inputs, Plan const&) {
    Header const& in = inputs.front();
    rule_ = {in.values, above.value_or(Number(-HUGE_VAL)), below.value_or(Number(HUGE_VAL)), above || otsu,
             below.has_value()};
    if (range) rule_.low = range->low, rule_.high = range->high;
    inside_ = finest_inside_ = region_in(in);
    voxels_ = in.voxels();
    nan_ = 0;
    scans_again_ = false;
    found_ = otsu ? std::make_unique<Otsu>(in.dtype, in.values.slope < 0) : nullptr;
}

void Threshold::enter_level(Index3 cell_width, Index3 first) {
    inside_ = cells_centred_in({finest_inside_.lower - first, finest_inside_.upper - first}, cell_width);
}

void Threshold::scan(ConstView slab, Execution const& execution) {
    Box const inside = roi.empty() ? slab.box : intersect(slab.box, inside_);
    if (!inside.empty()) found_->add(slab.part(inside), execution);
}

void Threshold::scan_end() {
    scans_again_ = found_->end_pass();
    if (scans_again_) return;
    Number const stored = found_->threshold();
    rule_.low = rule_.map == ValueMap{} ? stored : Number(rule_.map.physical(stored.value));
}

void Threshold::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = roi.empty() ? out.box : intersect(out.box, inside_);
    if (inside != out.box) fill_box(out, VoxelBytes{}, execution);
    if (inside.empty()) return;
    Losses losses;
    threshold_box(inputs.front().part(inside), out.part(inside), rule_, losses, execution);
    nan_ += losses.undefined;
}

std::vector<Remark> Threshold::remarks() const {
    if (nan_ == 0) return {};
    return {{text(share_text(nan_, voxels_), " not a number, stored as 0"), true}};
}

Report Threshold::report() const {
    Report report;
    auto const add = [&](std::string name, Number const& n) { report.add_number(std::move(name), to_text(n)); };
    if (above || otsu) add("above", rule_.low);
    if (below) add("below", rule_.high);
    if (range) add("low", rule_.low), add("high", rule_.high);
    return report;
}

} // namespace vkt
