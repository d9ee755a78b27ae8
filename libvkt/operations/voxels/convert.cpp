// Convert: rows go through float where that is exact, through double otherwise, 64-bit integers directly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/convert.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/tree.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/foreground.h"
#include "libvkt/operations/common/kernels/convert.h"

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
        "what they were. Percentiles of a hierarchical volume leave out the cells of its background, minmax takes it "
        "in. "
        "What is lost is counted and reported. --dtype auto chooses the smallest type that changes no "
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

double Convert::first_of(DataType type) const {
    return to ? to->low.value.value : is_integer(type) ? lowest_of(type) : 0;
}
double Convert::last_of(DataType type) const {
    return to ? to->high.value.value : is_integer(type) ? highest_of(type) : 1;
}

Plan Convert::plan(std::span<Header const> inputs) const {
    Header const& in = inputs.front();
    if (smallest()) return plan_smallest(in);
    DataType const type = type_for(in);
    Plan plan;
    plan.output = in;
    plan.output.dtype = type;
    plan.passing = ErrorPassing::computed(1, values_of(in));
    plan.passing.storing = range ? ErrorPassing::Storing::computes : ErrorPassing::Storing::converts;
    plan.passing.clips = is_integer(type);
    if (copies(in)) {
        plan.passing.storing = ErrorPassing::Storing::moves;
        plan.shift = Index3{};
        plan.method = "copy";
        plan.cost = 0;
        return plan;
    }
    plan.method = range ? "linear map, rounded half to even, saturated" : "rounded half to even, saturated";
    if (!range) return plan;
    double const first = first_of(type), last = last_of(type);
    if (first < lowest_of(type) || last > highest_of(type))
        throw Error(ErrorKind::usage, text("--to ", first, ":", last, " does not fit into ", type));
    plan.error.kind = ErrorBound::Kind::bound;
    // Of the range that is mapped, which percentiles do not make wider than the data's.
    double const largest = std::max(std::abs(first), std::abs(last));
    double const share = 0x1p-53 * (5 + largest / (last / 2 - first / 2) / 2);
    RangeScan const scan(*range, in);
    double const stores = storing_error(type);
    double const width = last - first; // of stored values that the range becomes
    double const stored_share = std::isfinite(largest / width) ? stores * largest / width : 1;
    // The maps of both sides round as well: a few units in the last place of what their terms reach.
    plan.error.magnitude = 4 * 0x1p-53;
    plan.error.absolute = 8 * 0x1p-53 * std::abs(in.values.intercept);
    if (!range->depends()) {
        double const low = range->low.value.value, high = range->high.value.value;
        plan.error.absolute +=
            (share + stored_share) * (high - low) + 8 * 0x1p-53 * std::max(std::abs(low), std::abs(high));
        plan.output.values = map_for(in, scan.low(), scan.high()).values;
        return plan;
    }
    plan.error.range = share + stored_share;
    plan.scans = true;
    plan.method = scan.has_percentiles() ? "percentiles first, then linear map" : "extremes first, then linear map";
    plan.state_bytes = scan.state_bytes();
    return plan;
}

/// The result is as large as the input at most.
Plan Convert::plan_smallest(Header const& in) const {
    Plan plan;
    plan.output = in;
    plan.scans = true;
    plan.method = text("smallest type within ", tolerance.value_or(0), ", chosen after a look at all voxels");
    plan.cost = 4;
    plan.error.kind = ErrorBound::Kind::bound;
    plan.error.absolute = tolerance.value_or(0);
    plan.passing = ErrorPassing::computed(1, values_of(in));
    plan.passing.own = tolerance.value_or(0);
    return plan;
}

/// Holes of trees are converted as well.
TypeFit Convert::fit_of_background(Header const& in) const {
    TypeFit fit;
    auto const background = in.attributes.find("background");
    if (in.kind != Kind::hierarchical || background == in.attributes.end() || !is_number(background->second))
        return fit;
    double const held = in.values.stored(parse_double(background->second));
    Header one;
    one.dims = {1, 1, 1};
    one.dtype = DataType::float64;
    find_fit(dense_view(reinterpret_cast<std::byte const*>(&held), one.dtype, box_of(one.dims)), fit, {});
    return fit;
}

void Convert::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs.front();
    type_ = type_for(input_);
    map_ = {};
    map_.values = input_.values;
    counts_ = {};
    scan_.reset();
    scans_again_ = false;
    storage_.reset();
    looks_ = false;
    maps_ = range.has_value();
    copies_ = copies(input_);
    fit_ = smallest() ? fit_of_background(input_) : TypeFit{};
    if (!range) return;
    scan_.emplace(*range, input_);
    region_ = {{}, input_};
    cuts_ = input_.kind == Kind::hierarchical && !(region_.finest() == box_of(input_.dims));
    looks_ = range->depends();
    if (!range->depends()) map_ = map_for(input_, scan_->low(), scan_->high());
    background_ = looks_ && input_.kind == Kind::hierarchical ? stored_background(input_) : std::nullopt;
    if (background_ && !range->percentiles()) scan_background();
}

/// Holes have it, whether or not a brick does.
void Convert::scan_background() {
    with_type(input_.dtype, [&]<class T>(T) {
        T const cell = store_cell<T>(*background_);
        scan_->scan(dense_view(reinterpret_cast<std::byte const*>(&cell), input_.dtype, box_of({1, 1, 1})), {});
    });
}

void Convert::after_scan(Plan& plan) const {
    plan.output.values = map_.values;
    if (!storage_) return;
    plan.output.dtype = type_;
    plan.passing.own = storage_->error;
    double const low = input_.values.physical(fit_.extremes.low), high = input_.values.physical(fit_.extremes.high);
    ValueInterval const values{std::min(low, high), std::max(low, high)};
    if (fit_.extremes.low <= fit_.extremes.high && !fit_.infinite && values.finite() && !plan.passing.values)
        plan.passing.values = values;
}

void Convert::scan(ConstView slab, Execution const& execution) {
    if (!smallest()) {
        Box const box = uses_position() ? intersect(slab.box, region_.box()) : slab.box;
        if (box.empty()) return;
        ConstView const part = slab.part(box);
        bool const counts = background_ && range->percentiles(); // how many cells hold it is how bricks are cut
        ConstView const cells = counts ? without_background(part, *background_, foreground_) : part;
        if (!cells.box.empty()) scan_->scan(cells, execution);
        return;
    }
    TypeFit found;
    find_fit(slab, found, execution);
    fit_ = joined(fit_, found);
}

void Convert::scan_end() {
    if (smallest()) {
        storage_ = smallest_storage(fit_, input_, tolerance.value_or(0));
        type_ = storage_->type;
        copies_ = type_ == input_.dtype;
        maps_ = storage_->maps;
        map_.values = storage_->values;
        map_.low = storage_->low;
        map_.high = storage_->high;
        map_.to_low = 0;
        map_.to_high = storage_->codes;
        double const width = map_.high - map_.low;
        map_.scale = 1;
        map_.factor = width > 0 ? map_.to_high / width : 0;
        return;
    }
    scans_again_ = scan_->end_pass();
    if (scans_again_) return;
    looks_ = false;
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
    map_ = map_for(input_, low, high);
}

/// The map from a range of stored input values to stored output values, and the value map after it.
Convert::Map Convert::map_for(Header const& in, StoredValue low, StoredValue high) const {
    DataType const type = type_for(in);
    Map map;
    map.low = low;
    map.high = high;
    map.to_low = first_of(type);
    map.to_high = last_of(type);
    map.scale = std::isfinite(high - low) ? 1 : 0.25;
    double const extent = map.scale == 1
                              ? high - low
                              : high.value() * map.scale - low.value() * map.scale; // only floats are so far apart
    map.factor = (map.to_high - map.to_low) / extent;
    map.values.slope = in.values.slope / (map.factor * map.scale);
    map.values.intercept = in.values.physical(low.value()) - map.to_low * map.values.slope;
    if (!std::isfinite(map.values.slope) || map.values.slope == 0 || !std::isfinite(map.values.intercept))
        throw Error(ErrorKind::usage,
                    text("--range: ", in.values.physical(low.value()), ":", in.values.physical(high.value()),
                         " is too narrow or too wide to be mapped"));
    return map;
}

void Convert::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const in = inputs.front().part(out.box);
    if (copies_) return copy_region(in, out, execution);
    Losses losses;
    if (maps_) {
        double const low = map_.low.rest, high = map_.high.rest + static_cast<double>(map_.high.whole - map_.low.whole);
        LinearMap const map{map_.low.whole,     low, map_.scale, map_.factor, map_.to_low, std::min(low, high),
                            std::max(low, high)};
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
                maps_ ? text(", slope ", map_.values.slope, ", intercept ", map_.values.intercept) : std::string(),
                room);
}

std::vector<Remark> Convert::remarks() const {
    std::int64_t const voxels = input_.voxels();
    std::vector<Remark> result = store_remarks(counts_, voxels, type_);
    if (storage_) result.push_back({storage_text(), false});
    if (range && counts_.clipped > 0)
        result.front().message =
            text(share_text(counts_.clipped, voxels), " clipped to [", map_.to_low, ",", map_.to_high, "]");
    return result;
}

} // namespace vkt
