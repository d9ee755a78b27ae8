// CLAHE, host side: window, histograms of bricks, curves.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/clahe.h"

#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/common/remarks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <numeric>

namespace vkt {
namespace {

constexpr std::int64_t most_bricks = 4096; ///< along an axis

} // namespace

VKT_OPERATION(Clahe, "clahe")

Texts Clahe::texts() const {
    return {"Raise local contrast (CLAHE).",
            "Contrast-limited adaptive histogram equalisation in three dimensions: the histogram of each brick is "
            "limited and equalised, and every voxel is mapped by those of the eight bricks around it. Type and window "
            "of values are kept. The man page spells out what --clip-as makes of --clip."
            "\n\n"
            "Accuracy: Histograms are exact. Bound: (4 * slope + 16) * 2^-24 of the range (2^-53 for wide types) and "
            "(4 * slope + 4) of these of the largest magnitude, slope being that of the curves.",
            {{"As it is usually done", "vkt clahe volume.nrrd -o clear.nrrd"},
             {"Stronger, in larger bricks, without the rarest values",
              "vkt clahe volume.nrrd --clip 4 --bricks 4,4,4 --range p0.1:p99.9 | vkt stats"}}};
}

void Clahe::parameters(Parameters& p) {
    p.option("clip", clip_, "C", "limit of contrast (opencv, pizer: 2, skimage: 0.01, volkit: 0.85; inf: none)");
    p.option("clip-as", rule_, "RULE", "what the limit is a share of: see the man page");
    p.option("bricks", bricks_, "X,Y,Z", "bricks along each axis, of equal size");
    p.option("bins", bin_count_, "N", "bins of the window, 2 to 65536");
    p.option("range", range_, "LO:HI|minmax|pA:pB", "window of values; what lies outside is clipped");
    p.option("roi", roi_, "X0:X1,Y0:Y1,Z0:Z1", "work on these voxels as if they were the volume; keep the others");
}

double Clahe::clip() const {
    return clip_.value_or(rule_ == ClipRule::skimage ? 0.01 : rule_ == ClipRule::volkit ? 0.85 : 2);
}

/// No number of bins is the most exact: the limit is one of each bin, and cuts all of very many.
std::vector<Knob> Clahe::knobs() const { return {{"bins", {"64", "128", "256", "1024", "4096"}, "", false}}; }

void Clahe::check() const {
    if (!(clip() > 0)) throw Error(ErrorKind::usage, text("--clip ", clip(), " is not above 0"), "inf limits nothing");
    bool const share = rule_ == ClipRule::skimage || rule_ == ClipRule::volkit;
    if (share && clip() > 1 && std::isfinite(clip()))
        throw Error(ErrorKind::usage,
                    text("--clip ", clip(), " is no share ",
                         rule_ == ClipRule::skimage ? "of a brick's voxels" : "of the tallest bin"),
                    "with this --clip-as it is at most 1; --clip-as opencv takes multiples of the average bin");
    if (bin_count_ < 2 || bin_count_ > Bins::most)
        throw Error(ErrorKind::usage, text("--bins ", bin_count_, " is not between 2 and ", Bins::most));
    for (int axis = 0; axis < 3; ++axis)
        if (bricks_[axis] < 1 || bricks_[axis] > most_bricks)
            throw Error(ErrorKind::usage, text("--bricks ", bricks_[axis], " is not between 1 and ", most_bricks));
}

Clahe::Window Clahe::window_for(Header const& in, RangeScan const& ends) const {
    Window window;
    ClaheField& field = window.field;
    field.bins = bin_count_;
    field.grid.box = roi_.empty() ? box_of(in.dims) : roi_.resolve(in.dims);
    for (int axis = 0; axis < 3; ++axis) field.grid.bricks[axis] = std::min(bricks_[axis], field.grid.box.dims()[axis]);
    field.whole = is_integer(in.dtype) && size_of(in.dtype) == 8;
    field.wide = field.whole || size_of(in.dtype) == 8 || (is_integer(in.dtype) && size_of(in.dtype) == 4);
    if (!range_.depends()) set_ends(window, in.dtype, ends.low(), ends.high());
    return window;
}

Plan Clahe::plan(std::span<Header const> inputs) const {
    check();
    Header const& in = inputs.front();
    RangeScan const ends(range_, in);
    ClaheField const field = window_for(in, ends).field;
    Plan plan;
    plan.output = in;
    plan.scans = true;
    plan.cost = 180;
    Index3 const b = field.grid.bricks;
    plan.method = text("CLAHE, ", b.x, "x", b.y, "x", b.z, " bricks, ", bin_count_, " bins, clip ", clip(), " as ",
                       enum_name(rule_));
    double const counters = static_cast<double>(bin_count_ + 3) * sizeof(std::uint64_t),
                 curves = static_cast<double>(curve_bytes(field));
    auto const columns = static_cast<double>(b.x * b.y); // at most 2^24
    double const tables = columns * static_cast<double>(b.z) * (counters + curves) + columns * curves;
    plan.state_bytes = static_cast<std::size_t>(std::min(tables, 0x1p62)) + ends.state_bytes();
    // A bin's share of the result is its share of the voxels; what rounding places wrongly, it magnifies.
    double const n = bin_count_, c = clip();
    double const steepest = std::min(n, rule_ == ClipRule::opencv    ? c + 1
                                        : rule_ == ClipRule::pizer   ? std::max(c, 1.0)
                                        : rule_ == ClipRule::skimage ? c * n + 1
                                                                     : n);
    double const unit = field.wide ? 0x1p-53 : 0x1p-24;
    plan.error.kind = ErrorBound::Kind::bound;
    plan.passing = ErrorPassing::computed(HUGE_VAL, {});
    plan.passing.because = "its curves follow counts of values";
    plan.error.range = (4 * steepest + 16) * unit;
    plan.error.magnitude = (4 * steepest + 4) * unit + storing_error(in.dtype);
    plan.error.limit(in.dtype, in.values.slope, std::nullopt);
    return plan;
}

void Clahe::begin(std::span<Header const> inputs, Plan const& plan) {
    input_ = inputs.front();
    error_ = plan.error;
    losses_ = {};
    counts_ = {};
    scans_again_ = false;
    ends_.emplace(range_, input_);
    ends_known_ = !range_.depends();
    window_ = window_for(input_, *ends_);
}

/// Bins and map of a window of stored values, given in any order.
void Clahe::set_ends(Window& window, DataType type, StoredValue low, StoredValue high) const {
    ClaheField& field = window.field;
    if (high - low < 0) std::swap(low, high);
    double const extent = high - low;
    window.copies = !(extent > 0);
    if (window.copies) return;
    auto const number = [](StoredValue const& v) {
        if (v.rest != 0) return Number(v.value());
        Number result(v.value());
        result.whole = v.whole;
        return result;
    };
    window.bins = Bins(type, {}, number(low), number(high), bin_count_);
    field.low = low.value();
    field.high = high.value();
    field.scale = 1;
    if (field.whole) { // from the integer part of the lower end on
        field.base = low.whole;
        if (low.whole == 0) field.base = static_cast<Int128>(std::floor(std::clamp(low.rest, -0x1p100, 0x1p100)));
        StoredValue const base{field.base, 0};
        field.low = low - base;
        field.high = high - base;
    }
    double const smallest_float = std::numeric_limits<float>::min() * 0x1p20;
    if (!field.wide && !(extent < 0x1p120 && extent > smallest_float * bin_count_)) field.wide = true;
    if (!std::isfinite(extent)) field.scale = 0.25;
    if (extent < 0x1p-900) field.scale = 0x1p500;
    field.scaled_low = field.low * field.scale;
    field.scaled_width = field.high * field.scale - field.scaled_low;
    field.per_unit = bin_count_ / field.scaled_width;
}

void Clahe::scan(ConstView slab, Execution const& execution) {
    scanned_with_ = execution;
    Box const box = intersect(slab.box, window_.field.grid.box);
    if (box.empty() || window_.copies) return;
    if (!ends_known_) return ends_->scan(slab.part(box), execution);
    std::size_t const counters = window_.bins.slots() * static_cast<std::size_t>(window_.field.grid.count());
    if (counts_.size() != counters) counts_ = VoxelCounts(counters);
    count_in_bins(slab.part(box), window_.bins, window_.field.grid, counts_.update(execution.space()), execution);
}

void Clahe::scan_end() {
    scans_again_ = false;
    if (!ends_known_) {
        if (ends_->end_pass()) {
            scans_again_ = true;
            return;
        }
        ends_known_ = true;
        window_.copies = !ends_->known();
        if (!window_.copies) set_ends(window_, input_.dtype, ends_->low(), ends_->high());
        scans_again_ = !window_.copies;
        return;
    }
    if (!window_.copies) make_curves();
}

void Clahe::make_curves() {
    ClipLimit const limit{rule_, clip()};
    if (rule_ == ClipRule::pizer) scanned_with_.device = Device::cpu;
    curves_ = Buffer(static_cast<std::size_t>(window_.field.grid.count()) * curve_bytes(window_.field));
    Space const space = scanned_with_.space();
    clahe_curves(counts_.read(space), window_.field, limit, curves_.write(space), scanned_with_);
    counts_ = {};
}

void Clahe::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = window_.copies ? Box{} : intersect(out.box, window_.field.grid.box);
    if (!(inside == out.box)) copy_region(inputs[0].part(out.box), out, execution);
    if (!inside.empty())
        clahe_map(inputs[0].part(inside), out.part(inside), window_.field, curves_, losses_, execution);
}

std::vector<Remark> Clahe::remarks() const {
    std::int64_t const voxels = window_.field.grid.box.voxels();
    if (window_.copies) return {{"the window is a single value: nothing was changed", false}};
    if (losses_.clipped == 0) return {};
    double const a = input_.values.physical(window_.bins.edge(0)),
                 b = input_.values.physical(window_.bins.edge(bin_count_));
    return {
        {text(share_text(losses_.clipped, voxels), " clipped to [", std::min(a, b), ",", std::max(a, b), "]"), true}};
}

} // namespace vkt
