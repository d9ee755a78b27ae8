// Threshold: 1 where the value lies in a range, 0 elsewhere.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/threshold.h"
#include "libvkt/amr/tree.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/foreground.h"
#include "libvkt/operations/common/level_region.h"
#include "libvkt/operations/common/number_range.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/voxels/kernels/fill.h"
#include "libvkt/operations/voxels/otsu.h"

#include <memory>
#include <vector>

namespace vkt {

namespace {

/// Masks in uint8. `above` and `below` are strict, both ends of `range` belong to it, and `otsu` is above the threshold
/// that separates the finite voxels into the two classes of least variance (see Otsu). Physical values are compared, as
/// slope * stored + intercept is in float64; without a value map stored ones, exactly, whatever the types. NaN is 0
/// everywhere, and counted. One read and one write; otsu reads once or twice before.
class Threshold : public Operation {
public:
    std::optional<Number> above, below;
    std::optional<NumberRange> range;
    bool otsu = false;
    Roi roi; ///< all voxels outside of it become 0, and otsu does not look at them

    std::string_view name() const override { return "threshold"; }
    Texts texts() const override {
        return {"Make a mask: 1 where the value lies in a range, 0 elsewhere.",
                "The result is uint8. --above and --below leave out the number itself, --range takes both of its ends. "
                "--otsu finds the threshold that separates the values best and keeps what is above it; --report tells "
                "which. Cells of a hierarchical volume that hold its background do not count there. Values are "
                "physical; NaN is 0."
                "\n\n"
                "Accuracy: Exact: values are compared as they are, integers of 64 bits too.",
                {{"Bone in a CT", "vkt threshold volume.nrrd --above 100 -o bone.nrrd"},
                 {"One label", "vkt threshold volume.nrrd --range 3:3 | vkt stats"},
                 {"Foreground, and the threshold that was found",
                  "vkt threshold volume.nrrd --otsu --report threshold.json -o mask.nrrd"}}};
    }

    Shape shape() const override { return Shape::pointwise; }
    void parameters(Parameters& p) override {
        p.option("above", above, "T", "1 where the value is greater than T");
        p.option("below", below, "T", "1 where the value is less than T; with --above, between the two");
        p.option("range", range, "LO:HI", "1 where LO <= value <= HI; an end may be left out");
        p.flag("otsu", otsu, "1 above the threshold that separates the values best (Otsu's)");
        p.option("roi", roi, "REGION", "look only at the voxels of this region; the others become 0");
    }

    void check() const override {
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

    Plan plan(std::span<Header const> inputs) const override {
        Header const& in = inputs.front();
        static_cast<void>(LevelRegion(roi, in)); // or it is refused
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

    void begin(std::span<Header const> inputs, Plan const&) override {
        Header const& in = inputs.front();
        rule_ = {in.values, above.value_or(Number(-HUGE_VAL)), below.value_or(Number(HUGE_VAL)), above || otsu,
                 below.has_value()};
        if (range) rule_.low = range->low, rule_.high = range->high;
        inside_ = {roi, in};
        cuts_ = in.kind == Kind::hierarchical && !(inside_.finest() == box_of(in.dims));
        looks_ = otsu;
        met_ = false;
        background_ = in.kind == Kind::hierarchical ? stored_background(in) : std::nullopt;
        voxels_ = in.voxels();
        nan_ = 0;
        scans_again_ = false;
        found_ = otsu ? std::make_unique<Otsu>(in.dtype, in.values.slope < 0) : nullptr;
    }

    void enter_level(Index3 cell_width, Index3 first) override { inside_.enter_level(cell_width, first); }

    void scan(ConstView slab, Execution const& execution) override {
        Box const inside = uses_position() ? intersect(slab.box, inside_.box()) : slab.box;
        if (inside.empty()) return;
        ConstView const part = slab.part(inside);
        ConstView const cells = background_ ? without_background(part, *background_, foreground_) : part;
        if (cells.box.empty()) return;
        found_->add(cells, execution);
        met_ = true;
    }

    void scan_end() override {
        bool const nothing = background_ && !met_; // and no threshold among that
        scans_again_ = !nothing && found_->end_pass();
        if (scans_again_) return;
        looks_ = false;
        Number const stored = nothing ? Number(*background_) : found_->threshold();
        rule_.low = rule_.map == ValueMap{} ? stored : Number(rule_.map.physical(stored.value));
    }

    bool scans_again() const override { return scans_again_; }
    /// Otsu looks at what is left of a cropped tree; its bricks hold what was cut off, too.
    bool uses_position() const override { return !roi.empty() || (looks_ && cuts_); }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override {
        Box const inside = inside_.part_of(out.box);
        if (inside != out.box) fill_box(out, VoxelBytes{}, execution);
        if (inside.empty()) return;
        Losses losses;
        threshold_box(inputs.front().part(inside), out.part(inside), rule_, losses, execution);
        nan_ += losses.undefined;
    }

    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return {&nan_}; }
    std::vector<Remark> remarks() const override {
        if (nan_ == 0) return {};
        return {{text(share_text(nan_, voxels_), " not a number, stored as 0"), true}};
    }

    bool reports() const override { return true; }
    /// Numbers of voxels, and the bounds in physical values: "above" alone if otsu chose it.
    Report report() const override {
        Report report;
        auto const add = [&](std::string name, Number const& n) { report.add_number(std::move(name), to_text(n)); };
        if (above || otsu) add("above", rule_.low);
        if (below) add("below", rule_.high);
        if (range) add("low", rule_.low), add("high", rule_.high);
        return report;
    }

private:
    ThresholdRule rule_;
    std::unique_ptr<Otsu> found_;
    bool scans_again_ = false;
    LevelRegion inside_;
    bool looks_ = false, cuts_ = false; ///< for a threshold; its region is not all of a tree
    std::optional<double> background_;  ///< of a tree: how many cells hold it is how it is cut into bricks
    std::vector<std::byte> foreground_;
    bool met_ = false; ///< a cell that does not
    std::int64_t voxels_ = 0, nan_ = 0;
};

} // namespace

VKT_OPERATION(Threshold, "threshold")

} // namespace vkt
