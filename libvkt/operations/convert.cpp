// Convert: rows go through float where that is exact, through double otherwise, 64-bit integers directly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/convert.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/kernels/convert.h"

#include <cmath>
#include <limits>

namespace vkt {

VKT_OPERATION(Convert, "convert")

void Convert::parameters(Parameters& p) {
    p.option("dtype", dtype, "TYPE", "data type of the result").alias("data-format");
    p.option("range", range, "LO:HI|minmax|pA:pB",
             "map these values to the full range of the result; what lies outside is clipped");
    p.option("to", to, "LO:HI", "with --range: map to these stored values instead");
}

std::vector<Knob> Convert::knobs() const {
    return {{"dtype", {"uint8", "int8", "uint16", "int16", "float16", "float32"}, "float64"}};
}

void Convert::check() const {
    if (to && !range) throw Error(ErrorKind::usage, "--to needs --range");
    if (to && (to->low.percentile || to->high.percentile))
        throw Error(ErrorKind::usage, "--to takes two numbers, as in 0:255");
}

Plan Convert::plan(std::span<Header const> inputs) {
    input_ = inputs.front();
    type_ = dtype.value_or(input_.dtype);
    values_ = input_.values;
    counts_ = {};
    scan_.reset();
    scans_again_ = false;
    Plan plan;
    plan.output = input_;
    plan.output.dtype = type_;
    copies_ = !range && type_ == input_.dtype;
    plan.passing = ErrorPassing::computed(1, values_of(input_));
    plan.passing.storing = range ? ErrorPassing::Storing::computes : ErrorPassing::Storing::converts;
    plan.passing.clips = is_integer(type_);
    if (copies_) {
        plan.passing.storing = ErrorPassing::Storing::moves;
        plan.shift = Index3{};
        plan.method = "copy";
        plan.cost = 0;
        return plan;
    }
    plan.method = range ? "linear map, rounded half to even, saturated" : "rounded half to even, saturated";
    if (!range) return plan;
    to_low_ = to ? to->low.value.value : is_integer(type_) ? lowest_of(type_) : 0;
    to_high_ = to ? to->high.value.value : is_integer(type_) ? highest_of(type_) : 1;
    if (to_low_ < lowest_of(type_) || to_high_ > highest_of(type_))
        throw Error(ErrorKind::usage, text("--to ", to_low_, ":", to_high_, " does not fit into ", type_));
    plan.error.kind = ErrorBound::Kind::bound;
    // Of the range that is mapped, which percentiles do not make wider than the data's.
    double const share =
        0x1p-53 * (5 + std::max(std::abs(to_low_), std::abs(to_high_)) / (to_high_ / 2 - to_low_ / 2) / 2);
    bool const known = !range->depends();
    scan_.emplace(*range, input_);
    double const stores = storing_error(type_), largest = std::max(std::abs(to_low_), std::abs(to_high_));
    double const width = to_high_ - to_low_; // of stored values that the range becomes
    double const stored_share = std::isfinite(largest / width) ? stores * largest / width : 1;
    // The maps of both sides round as well: a few units in the last place of what their terms reach.
    plan.error.magnitude = 4 * 0x1p-53;
    plan.error.absolute = 8 * 0x1p-53 * std::abs(input_.values.intercept);
    if (known) {
        double const low = range->low.value.value, high = range->high.value.value;
        plan.error.absolute +=
            (share + stored_share) * (high - low) + 8 * 0x1p-53 * std::max(std::abs(low), std::abs(high));
    } else {
        plan.error.range = share + stored_share;
    }
    if (known) {
        set_map(scan_->low(), scan_->high());
        plan.output.values = values_;
        return plan;
    }
    plan.scans = true;
    plan.method = scan_->has_percentiles() ? "percentiles first, then linear map" : "extremes first, then linear map";
    plan.state_bytes = scan_->state_bytes();
    return plan;
}

void Convert::scan(ConstView slab, Execution const& execution) { scan_->scan(slab, execution); }

void Convert::scan_end() {
    scans_again_ = scan_->end_pass();
    if (scans_again_) return;
    if (!scan_->known())
        throw Error(ErrorKind::data, "no voxel is a finite number: there is no range to map",
                    "give numbers: --range LO:HI");
    StoredValue const low = scan_->low(), high = scan_->high();
    double const first = input_.values.physical(low.value()) + 0.0, last = input_.values.physical(high.value()) + 0.0;
    if (!std::isfinite(first) || !std::isfinite(last))
        throw Error(ErrorKind::data, text("the volume's range reaches from ", first, " to ", last),
                    "use percentiles, as in --range p1:p99");
    if (!(input_.values.slope > 0 ? high - low > 0 : high - low < 0))
        throw Error(ErrorKind::data, text("the range to map is empty: it reaches from ", first, " to ", last),
                    "give numbers: --range LO:HI");
    set_map(low, high);
}

/// Fixes the map from a range of stored input values to stored output values, and the value map after it.
void Convert::set_map(StoredValue low, StoredValue high) {
    low_ = low;
    high_ = high;
    scale_ = std::isfinite(high - low) ? 1 : 0.25;
    double const extent =
        scale_ == 1 ? high - low : high.value() * scale_ - low.value() * scale_; // only floats are so far apart
    factor_ = (to_high_ - to_low_) / extent;
    values_.slope = input_.values.slope / (factor_ * scale_);
    values_.intercept = input_.values.physical(low_.value()) - to_low_ * values_.slope;
    if (!std::isfinite(values_.slope) || values_.slope == 0 || !std::isfinite(values_.intercept))
        throw Error(ErrorKind::usage,
                    text("--range: ", input_.values.physical(low_.value()), ":", input_.values.physical(high_.value()),
                         " is too narrow or too wide to be mapped"));
}

void Convert::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const in = inputs.front().part(out.box);
    if (copies_) return copy_region(in, out, execution);
    Losses losses;
    if (range) {
        double const low = low_.rest, high = high_.rest + static_cast<double>(high_.whole - low_.whole);
        LinearMap const map{low_.whole, low, scale_, factor_, to_low_, std::min(low, high), std::max(low, high)};
        convert_range(in, out, map, losses, execution);
    } else
        convert_values(in, out, losses, execution);
    counts_.clipped += losses.clipped;
    counts_.nan += losses.nan;
}

std::vector<Remark> Convert::remarks() const {
    std::int64_t const voxels = input_.voxels();
    std::vector<Remark> result = store_remarks(counts_, voxels, type_);
    if (range && counts_.clipped > 0)
        result.front().message =
            text(share_text(counts_.clipped, voxels), " clipped to [", to_low_, ",", to_high_, "]");
    return result;
}

} // namespace vkt
