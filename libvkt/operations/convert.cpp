// Convert: rows go through float where that is exact, through double otherwise, 64-bit integers directly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/convert.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/kernels/convert.h"

#include <cmath>
#include <limits>

namespace vkt {

VKT_OPERATION(Convert, "convert")

std::vector<std::string> ValueText<ResultType>::choices() {
    std::vector<std::string> names = ValueText<DataType>::choices();
    names.emplace_back("auto");
    return names;
}

ResultType ValueText<ResultType>::read(std::vector<std::string> const& w, std::string_view name) {
    if (w.front() == "auto") return ResultType::automatic();
    return ValueText<DataType>::read(w, name);
}

Texts Convert::texts() const {
    return {
        "Change the data type of a volume, or the format of a file.",
        "Values are kept, rounded half to even and clipped to what the type holds. With --range the values in the "
        "range are spread over the "
        "whole type (0 to 1 for floats), and the header's slope and intercept are set so that physical values stay "
        "what they were. What is lost is counted and reported. --dtype auto chooses the smallest type that changes no "
        "physical value by more than --tolerance, if need be with a slope and intercept, after a look at all voxels. "
        "Without --dtype and --range voxels stay as they are."
        "\n\n"
        "Accuracy: Correctly rounded, and exact where the new type holds all values of the old one; with a range "
        "within 5 * 2^-53 of the new range.",
        {{"To another format", "vkt convert volume.nrrd volume.mha"},
         {"To floats", "vkt make noise --dims 32 32 32 --dtype uint16 | vkt convert --dtype float32 | vkt stats"},
         {"To bytes, the darkest and brightest per cent clipped",
          "vkt make marschner-lobb --dims 40 40 40 | vkt convert --dtype uint8 --range p1:p99 | vkt stats"},
         {"The smallest type that holds the values within 0.01",
          "vkt make marschner-lobb --dims 40 40 40 | vkt convert --dtype auto --tolerance 0.01 | vkt stats"}}};
}

void Convert::parameters(Parameters& p) {
    p.option("dtype", dtype, "TYPE", "data type of the result, or auto: the smallest that holds the voxels")
        .alias("data-format");
    p.option("tolerance", tolerance, "T", "with --dtype auto: largest change of a physical value (0: none)");
    p.option("range", range, "LO:HI|minmax|pA:pB",
             "map these values to the full range of the result; what lies outside is clipped");
    p.option("to", to, "LO:HI", "with --range: map to these stored values instead");
}

std::vector<Knob> Convert::knobs() const {
    return {{"dtype", {"uint8", "int8", "uint16", "int16", "float16", "float32"}, "float64"}};
}

void Convert::check() const {
    if (tolerance && !smallest())
        throw Error(ErrorKind::usage, "--tolerance is for --dtype auto", "a type that is named is taken as it is");
    if (tolerance && !(*tolerance >= 0 && std::isfinite(*tolerance)))
        throw Error(ErrorKind::usage, text("--tolerance ", *tolerance, " is not a finite number >= 0"));
    if (smallest() && range)
        throw Error(ErrorKind::usage, "--dtype auto chooses its own range: --range has no meaning with it",
                    "name a type, as in --dtype uint8 --range minmax");
    if (to && !range) throw Error(ErrorKind::usage, "--to needs --range");
    if (to && (to->low.percentile || to->high.percentile))
        throw Error(ErrorKind::usage, "--to takes two numbers, as in 0:255");
}

Plan Convert::plan(std::span<Header const> inputs) {
    input_ = inputs.front();
    type_ = dtype && !dtype->smallest ? dtype->type : input_.dtype;
    values_ = input_.values;
    counts_ = {};
    scan_.reset();
    scans_again_ = false;
    storage_.reset();
    maps_ = range.has_value();
    if (smallest()) return plan_smallest();
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

/// The result is as large as the input at most.
Plan Convert::plan_smallest() {
    fit_ = {};
    copies_ = false;
    Plan plan;
    plan.output = input_;
    plan.scans = true;
    plan.method = text("smallest type within ", tolerance.value_or(0), ", chosen after a look at all voxels");
    plan.cost = 4;
    plan.error.kind = ErrorBound::Kind::bound;
    plan.error.absolute = tolerance.value_or(0);
    plan.passing = ErrorPassing::computed(1, values_of(input_));
    plan.passing.own = tolerance.value_or(0);
    if (input_.kind == Kind::hierarchical) // holes are converted as well
        if (auto const background = input_.attributes.find("background");
            background != input_.attributes.end() && is_number(background->second)) {
            double const held = input_.values.stored(parse_double(background->second));
            Header one;
            one.dims = {1, 1, 1};
            one.dtype = DataType::float64;
            find_fit(dense_view(reinterpret_cast<std::byte const*>(&held), one.dtype, box_of(one.dims)), fit_, {});
        }
    return plan;
}

void Convert::after_scan(Plan& plan) const {
    plan.output.values = values_;
    if (!storage_) return;
    plan.output.dtype = type_;
    plan.passing.own = storage_->error;
    double const low = input_.values.physical(fit_.extremes.low), high = input_.values.physical(fit_.extremes.high);
    ValueInterval const values{std::min(low, high), std::max(low, high)};
    if (fit_.extremes.low <= fit_.extremes.high && !fit_.infinite && values.finite() && !plan.passing.values)
        plan.passing.values = values;
}

void Convert::scan(ConstView slab, Execution const& execution) {
    if (!smallest()) return scan_->scan(slab, execution);
    TypeFit found;
    find_fit(slab, found, execution);
    fit_ = joined(fit_, found);
}

void Convert::scan_end() {
    if (smallest()) {
        storage_ = smallest_storage(fit_, input_, tolerance.value_or(0));
        type_ = storage_->type;
        values_ = storage_->values;
        copies_ = type_ == input_.dtype;
        maps_ = storage_->maps;
        low_ = storage_->low;
        high_ = storage_->high;
        to_low_ = 0;
        to_high_ = storage_->codes;
        double const width = high_ - low_;
        scale_ = 1;
        factor_ = width > 0 ? to_high_ / width : 0;
        return;
    }
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
    if (maps_) {
        double const low = low_.rest, high = high_.rest + static_cast<double>(high_.whole - low_.whole);
        LinearMap const map{low_.whole, low, scale_, factor_, to_low_, std::min(low, high), std::max(low, high)};
        convert_range(in, out, map, losses, execution);
    } else
        convert_values(in, out, losses, execution);
    counts_.clipped += losses.clipped;
    counts_.nan += losses.nan;
}

/// "stored as uint8, slope 0.5, intercept -3: within 0.25, 1 byte a voxel instead of 4"
std::string Convert::storage_text() const {
    auto const bytes = [](DataType type) { return static_cast<std::uint64_t>(size_of(type)); };
    std::string const room =
        copies_ ? std::string(": no smaller type holds it")
                : text(storage_->error > 0 ? text(": within ", storage_->error) : ": exactly", ", ", bytes(type_),
                       bytes(type_) == 1 ? " byte" : " bytes", " a voxel instead of ", bytes(input_.dtype));
    return text(copies_ ? "stays " : "stored as ", type_,
                maps_ ? text(", slope ", values_.slope, ", intercept ", values_.intercept) : std::string(), room);
}

std::vector<Remark> Convert::remarks() const {
    std::int64_t const voxels = input_.voxels();
    std::vector<Remark> result = store_remarks(counts_, voxels, type_);
    if (storage_) result.push_back({storage_text(), false});
    if (range && counts_.clipped > 0)
        result.front().message =
            text(share_text(counts_.clipped, voxels), " clipped to [", to_low_, ",", to_high_, "]");
    return result;
}

} // namespace vkt
