// Resample: what is asked for, which tables that needs, and which kernel does it.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample.h"

#include "libvkt/amr/device_sampler.h"
#include "libvkt/core/fine_region.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/wide.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/formats/format.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/kernels/convert.h"
#include "libvkt/operations/kernels/resample.h"

#include <algorithm>
#include <cmath>

namespace vkt {

VKT_OPERATION(Resample, "resample")

Texts Resample::texts() const {
    return {"Resample a volume to another number of voxels, or onto another's grid.",
            "The volume keeps its extent in the world; voxels are cells, so the outer faces stay where they are. By "
            "default axes that shrink are averaged "
            "by area and axes that grow are interpolated linearly. nearest, linear and area keep the data type; cubic "
            "turns unsigned integers "
            "into floats, because it can leave their range.\n\n"
            "--like puts the volume onto the grid of another, wherever and however turned that lies in the world; what "
            "lies "
            "outside becomes --background.\n\n"
            "Hierarchical (AMR) volumes become structured ones: --cells 50M says how many voxels, --roi which part, in "
            "finest cells; --method basis (default) interpolates across levels, average conserves the integral."
            "\n\n"
            "Accuracy: nearest is exact. Of integers linear and area come out as in exact arithmetic, rounded once; "
            "floats are bounded by (n + 12) 2^-53 of the largest magnitude for n voxels that are summed, plus the "
            "rounding of what is stored; cubic by up to twice that.",
            {{"Half as many voxels along each axis",
              "vkt make sphere --dims 64 64 48 | vkt resample --scale 0.5 | vkt info"},
             {"Sizes in voxels, cubic",
              "vkt make sphere --dims 32 32 24 | vkt resample --dims 48 48 48 --method cubic | vkt info"},
             {"Onto the grid of another volume, to subtract it",
              "vkt make noise --dims 20 20 20 -o a.vkt && vkt make ramp --dims 30 30 30 --spacing 0.5 | vkt resample "
              "--like "
              "a.vkt | vkt arith sub - a.vkt | vkt stats"},
             {"A grid of about 20 000 voxels from an AMR volume",
              "vkt make amr --blocks 50 --levels 3 | vkt resample --cells 20k | vkt info"},
             {"Cubic voxels from slices",
              "vkt make sphere --dims 32 32 12 --spacing 1,1,2.5 | vkt resample --spacing 1 | vkt info"}}};
}

void Resample::parameters(Parameters& p) {
    p.option("scale", scale, "S|SX,SY,SZ", "factor for the numbers of voxels, rounded to the nearest");
    p.option("dims", dims, "X Y Z", "numbers of voxels of the result; any may be auto: in proportion to the others");
    p.option("spacing", spacing, "S|SX,SY,SZ",
             "size of the result's voxels in world units, met as nearly as whole voxels allow");
    p.option("like", like_.file, "FILE", "the grid of this volume: numbers of voxels, spacing, place and directions");
    p.option("cells", cells, "N", "about this many voxels, as cubic as can be; 50M are 50 millions");
    p.option("method", method, "METHOD",
             "auto (default): area average where an axis shrinks, linear where it grows; hierarchical volumes: basis "
             "(default), nearest, average, or auto: average where a voxel covers several cells or there are holes");
    p.option(
        "tolerance", tolerance, "T",
        "choose the cheapest of nearest, linear, cubic and lanczos3 whose estimated error is at most T, in units of "
        "values, after a look at the voxels; axes that shrink are averaged, the type stays");
    p.option("roi", roi, "REGION",
             "only this region; its ends may lie between voxels; of hierarchical volumes in finest cells");
    p.option("roi-world", world_roi, "REGION", "hierarchical volumes: only this region, in world units");
    p.option("background", background, "VALUE",
             "with --like, and for hierarchical volumes: value where there is no voxel or cell (0)");
    p.flag("mask", mask, "hierarchical volumes: 1 where there are cells and 0 in holes, as uint8, instead of values");
    p.option("boundary", boundary, "RULE",
             "how the volume continues outside, for linear and smoother methods and --like: mirror, clamp (default), "
             "wrap or border[:VALUE]");
    p.option("dtype", dtype, "TYPE", "data type of the result, values kept").alias("data-format");
    p.option("bytes-per-voxel", bytes_per_voxel, "N", "unsigned integers of this many bytes (volkit)").alias("bpv");
    p.option("dist", dist, "X Y Z",
             "spacing to write into the header, instead of the one that keeps the extent (volkit)")
        .values(3, 3);
    p.option("voxel-mapping", voxel_mapping, "LO HI",
             "values that the range of the result's integers stands for (volkit)")
        .alias("vm");
}

std::vector<Knob> Resample::knobs() const {
    if (from_tree_) return {{"method", {"nearest", "average", "basis"}, "basis", false}, type_knob()};
    if (tolerance) return {InterpolationChoice::knob(), type_knob()};
    // Where an axis shrinks a voxel stands for all that it covers; elsewhere the smoothest interpolant is the best
    // guess.
    bool const shrinks = to_.x < from_.x || to_.y < from_.y || to_.z < from_.z;
    return {{"method",
             {"nearest", "linear", "area", "cubic", "lanczos3", "bspline3", "bspline5"},
             shrinks ? "area" : "bspline5",
             false},
            type_knob()};
}

void Resample::check() const {
    int const given =
        (scale ? 1 : 0) + (dims ? 1 : 0) + (spacing ? 1 : 0) + (like_.file.empty() ? 0 : 1) + (cells ? 1 : 0);
    if (given > 1)
        throw Error(ErrorKind::usage, "only one of --scale, --dims, --spacing, --like and --cells can be followed");
    if (mask && changes_values())
        throw Error(ErrorKind::usage, "--mask is 0 or 1 in uint8: options that change values do not apply");
    if (!roi.empty() && !world_roi.empty()) throw Error(ErrorKind::usage, "--roi and --roi-world exclude each other");
    if (!like_.file.empty() && !(roi.empty() && world_roi.empty()))
        throw Error(ErrorKind::usage, "--like says the region too: --roi and --roi-world do not apply");
    if (boundary && background)
        throw Error(ErrorKind::usage, "--boundary continues the volume everywhere: --background does not apply");
    if (scale)
        for (int axis = 0; axis < 3; ++axis)
            if (!std::isfinite((*scale)[axis]) || !((*scale)[axis] > 0))
                throw Error(ErrorKind::usage, text("--scale: ", (*scale)[axis], " is not a positive factor"));
    if (dims && std::min({dims->value.x, dims->value.y, dims->value.z}) > 0)
        check_dims(dims->value, DataType::uint8, "dims");
    if (spacing) check_spacing(*spacing, "spacing");
    if (dist) check_spacing(*dist, "dist");
    if (bytes_per_voxel) {
        DataType const type = type_of_bytes(*bytes_per_voxel);
        if (dtype && size_of(*dtype) != size_of(type))
            throw Error(ErrorKind::usage,
                        text("--bytes-per-voxel ", *bytes_per_voxel, " contradicts --dtype ", *dtype));
    }
    if (tolerance) check_interpolation_tolerance(*tolerance, method.has_value());
    bool const looks_outside = !method || method == ResampleMethod::automatic || method == ResampleMethod::linear ||
                               has_lobes(*method) || !like_.file.empty();
    if (boundary && !looks_outside)
        throw Error(ErrorKind::usage,
                    text("--boundary does not apply to --method ", enum_name(*method), ", which never looks outside"));
}

namespace {

/// What was asked for is too large: not the data's fault.
void checked(Header const& output) {
    try {
        check(output);
    } catch (Error const& error) {
        throw Error(ErrorKind::usage, error.what(), error.hint());
    }
}

std::int64_t rounded_extent(double voxels) {
    double const n = std::floor(voxels + 0.5);
    if (!(n < static_cast<double>(max_extent)))
        throw Error(ErrorKind::usage, text("the result would have ", voxels, " voxels along an axis"));
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(n));
}

/// The numbers given, and for the axes without one the scale of those that have one.
Index3 filled_in(Index3 wanted, Index3 dims) {
    double factor = 0;
    for (int axis = 0; axis < 3; ++axis) {
        if (wanted[axis] == 0) continue;
        double const here = static_cast<double>(wanted[axis]) / static_cast<double>(dims[axis]);
        factor = factor == 0 ? here : std::min(factor, here);
    }
    for (int axis = 0; axis < 3; ++axis)
        if (wanted[axis] == 0) wanted[axis] = rounded_extent(static_cast<double>(dims[axis]) * factor);
    return wanted;
}

} // namespace

WantedDims ValueText<WantedDims>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> parts = w.size() == 1 ? split(w.front(), ',') : w;
    std::int64_t given = 0;
    for (auto& part : parts) {
        if (part == "auto") {
            part = "0";
            continue;
        }
        ++given;
        if (part == "0") throw Error(ErrorKind::usage, text(name, ": 0 is not a positive number of voxels"));
    }
    if (given == 0)
        throw Error(ErrorKind::usage, text(name, " gives no axis a number of voxels"),
                    "for example --dims 512,auto,auto");
    Index3 const dims = ValueText<Index3>::read(parts, name);
    if (std::min({dims.x, dims.y, dims.z}) < 0)
        throw Error(ErrorKind::usage, text(name, ": ", dims, " are not positive numbers of voxels"));
    return dims;
}

std::vector<std::string> ValueText<WantedDims>::write(WantedDims v) {
    std::vector<std::string> words(3, "auto");
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (std::int64_t const n = v.value[static_cast<int>(axis)]; n != 0) words[axis] = to_text(n);
    return words;
}

CellCount ValueText<CellCount>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string number = w.front();
    double factor = 1;
    if (!number.empty()) {
        char const unit = number.back();
        factor = unit == 'k' || unit == 'K' ? 1e3 : unit == 'M' ? 1e6 : unit == 'G' ? 1e9 : 1;
        if (factor > 1) number.pop_back();
    }
    double const count = ValueText<double>::read({number}, name) * factor;
    if (!(count >= 1 && count <= 1e15))
        throw Error(ErrorKind::usage, text(name, ": ", w.front(), " is not a number of cells"),
                    "for example --cells 50M");
    return {static_cast<std::int64_t>(std::llround(count))};
}

Index3 Resample::target_dims(Header const& input) const {
    Index3 const n = input.dims;
    return target_dims(input, {static_cast<double>(n.x), static_cast<double>(n.y), static_cast<double>(n.z)});
}

Index3 Resample::target_dims(Header const& input, Vec3 extent) const {
    if (dims) return filled_in(dims->value, input.dims);
    if (cells) {
        Header whole = input;
        whole.attributes.clear(); // whatever region a tree had that this grid came from
        GridRequest request;
        request.cells = cells->value;
        return plan_grid(whole, request).dims;
    }
    if (!like_.file.empty()) return like_.header().dims;
    Index3 result = input.dims;
    for (int axis = 0; axis < 3; ++axis) {
        double const n = extent[axis];
        if (scale) result[axis] = rounded_extent(n * (*scale)[axis]);
        if (spacing) result[axis] = rounded_extent(n * input.geometry.spacing[axis] / (*spacing)[axis]);
    }
    return result;
}

ResampleMethod Resample::used() const { return chosen_ ? *chosen_ : method.value_or(ResampleMethod::automatic); }

ResampleKernel Resample::kernel_of(std::int64_t n_in, std::int64_t n_out) const {
    double const width = static_cast<double>(n_in) / static_cast<double>(n_out);
    // An estimate says what lies between voxels, not what several of them amount to.
    return kernel_for(chosen_ && width > 1 ? ResampleMethod::automatic : used(), width);
}

/// The grid of --like, as its own header has it.
void Resample::take_grid(Header const& input, Header& output) const {
    Header const& like = like_.header();
    output.geometry = like.geometry;
    output.attributes.erase("space");
    if (auto const space = like.attributes.find("space"); space != like.attributes.end())
        output.attributes["space"] = space->second;
    if (!(like.dims == input.dims && same_place(like, input))) output.part.reset();
}

/// `moves`: no value is interpolated.
void Resample::choose_header(Header const& input, bool moves, Header& output) {
    output = input;
    output.dims = to_;
    output.geometry = rescaled(input.geometry, from_, to_);
    if (!(from_ == to_)) output.part.reset();
    if (!like_.file.empty()) take_grid(input, output);
    if (region_map_) {
        output.part.reset();
        output.geometry = input.geometry;
        output.geometry.origin = index_to_world(input.geometry, region_map_->offset);
        for (int a = 0; a < 3; ++a) output.geometry.spacing[a] *= region_map_->column[static_cast<std::size_t>(a)][a];
    }
    if (dist) output.geometry.spacing = *dist;
    bool const lobes = !tolerance && has_lobes(used()) && !moves;
    if (lobes && is_integer(input.dtype) && !is_signed(input.dtype))
        output.dtype = size_of(input.dtype) <= 2 ? DataType::float32 : DataType::float64;
    if (bytes_per_voxel && size_of(output.dtype) != size_of(type_of_bytes(*bytes_per_voxel)))
        output.dtype = type_of_bytes(*bytes_per_voxel);
    if (dtype) output.dtype = *dtype;
    scale_value_ = 1;
    offset_value_ = 0;
    if (!voxel_mapping) return;
    output.values = value_map_of(*voxel_mapping, output.dtype);
    if (output.values == input.values) return;
    scale_value_ = input.values.slope / output.values.slope;
    offset_value_ = (input.values.intercept - output.values.intercept) / output.values.slope;
}

Plan Resample::plan(std::span<Header const> inputs) {
    Header const& input = inputs.front();
    reconstructor_.reset();
    choice_.reset();
    chosen_.reset();
    preparation_ = nullptr;
    from_tree_ = input.kind == Kind::hierarchical;
    if (from_tree_) return plan_tree(input);
    refuse_tree_options();
    if (!tolerance) return planned(input);
    // Of what may be chosen the last one looks furthest.
    input_ = input;
    chosen_ = InterpolationChoice::candidates.back();
    Plan plan = planned(input);
    bool const moves =
        plan.passing.storing == ErrorPassing::Storing::moves || plan.passing.storing == ErrorPassing::Storing::converts;
    if (moves) return plan;
    Placement const placement = onto_ ? onto_->placement() : place(plan.output.geometry, to_, input.geometry);
    coarser_ = placement.coarser();
    std::array<bool, 3> axes = placement.between();
    for (int a = 0; a < 3 && !onto_; ++a) axes[static_cast<std::size_t>(a)] = to_[a] > from_[a];
    if (std::ranges::none_of(axes, [](bool between) { return between; })) { // averages and copies alone
        chosen_ = ResampleMethod::automatic;
        return planned(input);
    }
    choice_.emplace(input, box_of(input.dims), axes);
    choice_->announce(*tolerance, plan);
    return plan;
}

void Resample::scan(ConstView slab, Execution const&) { choice_->scan(slab); }

void Resample::scan_end() {
    chosen_ = choice_->choose(*tolerance, coarser_);
    plan_of_chosen_ = planned(input_);
}

void Resample::after_scan(Plan& plan) const {
    if (choice_) choice_->settle(plan_of_chosen_, plan);
}

/// A structured volume, by the method that is used.
Plan Resample::planned(Header const& input) {
    onto_.reset();
    region_map_.reset();
    if (!scale && !dims && !spacing && like_.file.empty() && !cells && !changes_values() && roi.empty())
        throw Error(ErrorKind::usage, "no new size is given", "say for example --scale 0.5 or --dims 128 128 64");
    Plan plan;
    from_ = input.dims;
    counts_ = {};
    if (!roi.empty()) return plan_region(input);
    to_ = target_dims(input);
    if (!like_.file.empty()) {
        Header const& like = like_.header();
        Geometry const grid = geometry_beside(input, like);
        bool const same = to_ == from_ && same_geometry(grid, input.geometry);
        Placement const placement = place(grid, to_, input.geometry);
        if (!same && !placement.keeps_extent(from_, to_)) return plan_onto(input, placement);
    }
    choose_header(input, from_ == to_, plan.output);
    checked(plan.output);
    out_type_ = plan.output.dtype;

    BoundaryRule const rule = boundary.value_or(BoundaryRule{});
    plan.boundary = rule.boundary;
    plan.border_value = border_ = rule.boundary == Boundary::border ? input.values.stored(rule.value) : 0;
    Index3 halving{};
    bool all_nearest = true;
    for (int axis = 0; axis < 3; ++axis) {
        WeightTable& table = tables_[static_cast<std::size_t>(axis)];
        table = WeightTable(from_[axis], to_[axis], kernel_of(from_[axis], to_[axis]), rule.boundary);
        halving[axis] = table.halving();
        all_nearest =
            all_nearest && (table.kernel() == ResampleKernel::nearest || table.kernel() == ResampleKernel::identity);
        plan.state_bytes += table.bytes();
    }
    bool const same_map = scale_value_ == 1 && offset_value_ == 0, same_values = same_map && out_type_ == input.dtype;
    algorithm_ = Algorithm::weighted;
    if (same_values && from_ == to_)
        algorithm_ = Algorithm::copy;
    else if (same_map && from_ == to_)
        algorithm_ = Algorithm::convert;
    else if (same_values && all_nearest)
        algorithm_ = Algorithm::nearest;
    else if (same_values && halving.x * halving.y * halving.z > 1)
        algorithm_ = Algorithm::halving;
    else if (same_values && sums_in_integers(input.dtype))
        algorithm_ = Algorithm::whole;
    if (algorithm_ == Algorithm::copy) plan.shift = Index3{};
    plan.method = describe();
    plan.error = error_of(input, plan.output);
    plan.passing =
        ErrorPassing::averaged(tables_[0].gain() * tables_[1].gain() * tables_[2].gain(), values_read(input, plan));
    if (algorithm_ == Algorithm::copy || algorithm_ == Algorithm::nearest)
        plan.passing.storing = ErrorPassing::Storing::moves;
    if (algorithm_ == Algorithm::convert) plan.passing.storing = ErrorPassing::Storing::converts;
    plan.cost = algorithm_ == Algorithm::copy || algorithm_ == Algorithm::convert || algorithm_ == Algorithm::nearest
                    ? 0
                    : multiply_adds(tables_, static_cast<double>(from_.x) / static_cast<double>(to_.x));
    return plan;
}

/// Of the arithmetic only: how well an interpolant represents what was sampled depends on the data.
ErrorBound Resample::error_of(Header const& input, Header const& output) const {
    ErrorBound error;
    bool const same_map = scale_value_ == 1 && offset_value_ == 0;
    if (algorithm_ == Algorithm::copy || algorithm_ == Algorithm::convert || algorithm_ == Algorithm::nearest ||
        algorithm_ == Algorithm::whole)
        return error;
    if (algorithm_ == Algorithm::halving && is_integer(input.dtype)) return error;
    if (algorithm_ == Algorithm::weighted && same_map && sums_exactly(input.dtype)) return error;
    error.kind = ErrorBound::Kind::bound;
    double const slope = std::abs(input.values.slope);
    if (algorithm_ == Algorithm::halving) { // three additions, in float32 for float16
        bool const half = input.dtype == DataType::float16;
        DataType const sums = half ? DataType::float32 : input.dtype;
        error.magnitude = 3 * storing_error(sums) + (half ? storing_error(input.dtype) : 0);
        error.absolute = slope * (8 * storing_floor(sums) + (half ? storing_floor(input.dtype) : 0));
        return error;
    }
    // A product and an addition for each row and each column, and a dozen roundings of weights, divisors, 64-bit
    // integers, the border's part and the quotient.
    auto const rows = static_cast<double>(tables_[1].most_taps() * tables_[2].most_taps());
    auto const columns = static_cast<double>(tables_[0].most_taps());
    double const gain = tables_[0].gain() * tables_[1].gain() * tables_[2].gain();
    error.magnitude = gain * ((rows + columns + 12) * 0x1p-53 + storing_error(output.dtype));
    error.absolute = slope * rows * columns * tables_[0].divisor() * 0x1p-1070 +
                     std::abs(output.values.slope) * storing_floor(output.dtype);
    if (!same_map) {
        error.magnitude += gain * 4 * 0x1p-53;
        error.absolute += (4 * 0x1p-53 + storing_error(output.dtype)) *
                          (std::abs(input.values.intercept) + std::abs(output.values.intercept));
    }
    bool const border = tables_[0].leaves_out() || tables_[1].leaves_out() || tables_[2].leaves_out();
    error.limit(input.dtype, slope, border ? std::optional(border_) : std::nullopt);
    return error;
}

/// The background as a volume stores it: the one that was asked for, or that the volume names, or 0, which trees that
/// have no holes need no room for.
double Resample::background_in(Header const& volume) const {
    std::optional<double> const named = background ? volume.values.stored(*background) : stored_background(volume);
    double const stored = named.value_or(volume.values.stored(0));
    bool const fits =
        !is_integer(volume.dtype) || (stored >= lowest_of(volume.dtype) && stored <= highest_of(volume.dtype));
    if (!fits && (named || !from_tree_))
        throw Error(ErrorKind::usage,
                    text("the background ", volume.values.physical(stored), " cannot be stored in ", volume.dtype),
                    from_tree_ ? "choose another --background" : "choose another --background, or a type with --dtype");
    return stored;
}

/// The outer faces of the result are the ends of the region.
Plan Resample::plan_region(Header const& input) {
    FineRegion const region = resolve_fine(roi, input.dims);
    Vec3 const extent = region.upper - region.lower;
    Header part = input;
    for (int a = 0; a < 3; ++a) part.dims[a] = rounded_extent(extent[a]);
    to_ = target_dims(part, extent);
    region_map_.emplace();
    for (int a = 0; a < 3; ++a) {
        double const width = extent[a] / static_cast<double>(to_[a]);
        region_map_->column[static_cast<std::size_t>(a)][a] = width;
        region_map_->offset[a] = region.lower[a] + 0.5 * (width - 1);
    }
    return plan_onto(input, place(*region_map_, to_));
}

Plan Resample::plan_onto(Header const& input, Placement const& placement) {
    Plan plan;
    choose_header(input, placement.whole(), plan.output);
    checked(plan.output);
    out_type_ = plan.output.dtype;
    OntoValues values{input.dtype, out_type_, scale_value_, offset_value_};
    if (boundary)
        values.border = input.values.stored(boundary->value);
    else
        values.background = background_in(plan.output);
    onto_.emplace(placement, from_, to_, used(), boundary, values);
    preparation_ = onto_->take_coefficients();
    onto_->describe(plan);
    onto_->pass(input, plan);
    return plan;
}

/// True if integers come out as by exact arithmetic, rounded once: no sum of whole weights times values, and no
/// distance of a quotient from a tie, is beyond double.
bool Resample::sums_exactly(DataType input) const {
    if (!is_integer(input) || has_lobes(used())) return false;
    double const divisor = tables_[0].divisor() * tables_[1].divisor() * tables_[2].divisor();
    bool const rounds_once = is_integer(out_type_) || out_type_ == DataType::float64;
    double const largest = std::max(std::exp2(8 * static_cast<double>(size_of(input))), std::abs(border_));
    return rounds_once && border_ == std::rint(border_) && largest * divisor <= 0x1p52;
}

/// True for 64-bit integers, of which double would lose digits, where 128 bits hold every sum of weights times values
/// and the border is one of the values.
bool Resample::sums_in_integers(DataType input) const {
    if (!is_integer(input) || size_of(input) != 8 || has_lobes(used())) return false;
    double const divisor = tables_[0].divisor() * tables_[1].divisor() * tables_[2].divisor();
    bool const inside = border_ >= lowest_of(input) && border_ < highest_of(input);
    return inside && border_ == std::rint(border_) && divisor <= 0x1p62;
}

void Resample::refuse_tree_options() const {
    if (method == ResampleMethod::basis || method == ResampleMethod::average)
        throw Error(ErrorKind::usage,
                    text("--method ", enum_name(*method), " is for hierarchical volumes, and this one is structured"),
                    method == ResampleMethod::average ? "--method area averages voxels" : "use --method linear");
    bool const region = !world_roi.empty();
    if (region || mask || (background && like_.file.empty()))
        throw Error(ErrorKind::usage,
                    text(region ? "--roi-world"
                         : mask ? "--mask"
                                : "--background",
                         " is for hierarchical volumes, and this one is structured"),
                    region ? "use vkt crop before"
                    : mask ? ""
                           : "with --like it says what lies outside");
}

Reconstruction Resample::reconstruction() const {
    switch (method.value_or(ResampleMethod::basis)) {
    case ResampleMethod::basis:
        return Reconstruction::basis;
    case ResampleMethod::nearest:
        return Reconstruction::nearest;
    case ResampleMethod::average:
        return Reconstruction::average;
    case ResampleMethod::automatic:
        return Reconstruction::automatic;
    case ResampleMethod::linear:
    case ResampleMethod::area:
    case ResampleMethod::cubic:
    case ResampleMethod::bspline3:
    case ResampleMethod::bspline5:
    case ResampleMethod::lanczos3:
        break;
    }
    throw Error(ErrorKind::usage,
                text("--method ", enum_name(*method), " is for structured volumes, and this one is hierarchical"),
                text("use --method ", method == ResampleMethod::area ? "average" : "basis"));
}

SampleGrid Resample::tree_grid(Header const& input) const {
    GridRequest request;
    request.roi = roi;
    request.world_roi = world_roi;
    request.spacing = spacing;
    if (!like_.file.empty()) return grid_like(input);
    if (cells) request.cells = cells->value;
    if (scale || dims) {
        Header region = input;
        region.dims = plan_grid(input, request).dims; // without any of the others: the region's finest cells
        request.dims = target_dims(region);
    }
    return plan_grid(input, request);
}

/// The grid of --like in finest cells.
SampleGrid Resample::grid_like(Header const& input) const {
    Header const& like = like_.header();
    Placement const p = place(geometry_beside(input, like), like.dims, input.geometry);
    if (!p.upright())
        throw Error(ErrorKind::usage, text("the grid of ", like_.file, " is turned against the bricks"),
                    "make a grid first: vkt resample --cells 50M | vkt resample --like");
    SampleGrid grid;
    grid.dims = like.dims;
    grid.step = p.scale;
    for (int a = 0; a < 3; ++a) grid.lower[a] = p.offset[a] + 0.5 - 0.5 * p.scale[a];
    return grid;
}

Plan Resample::plan_tree(Header const& input) {
    if (tolerance)
        throw Error(ErrorKind::usage, "--tolerance is for structured volumes, and this one is hierarchical",
                    "use --method basis, average or nearest");
    if (boundary)
        throw Error(ErrorKind::usage, "--boundary is for structured volumes, and this one is hierarchical",
                    "say with --background what stands where there is no cell");
    Plan plan;
    grid_ = tree_grid(input);
    plan.output = gridded_header(input, grid_);
    if (!like_.file.empty()) take_grid(input, plan.output);
    plan.method = enum_name(reconstruction());
    if (!mask && reconstruction() != Reconstruction::nearest) {
        bool const in_double = is_integer(input.dtype) || input.dtype == DataType::float64;
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = std::max(in_double ? 1e-15 : 1e-6, storing_error(input.dtype));
    }
    plan.cost = 16;
    plan.slab_hint = tile::extent_z;
    plan.state_bytes = static_cast<std::size_t>(input.brick_count) * Reconstructor::bytes_per_brick;
    stored_background_ = background_in(input);
    tree_type_ = input.dtype;
    values_.reset();
    if (mask) {
        plan.output.dtype = DataType::uint8;
        plan.output.values = {};
        plan.output.units.clear();
    } else if (changes_values()) { // the grid stays, the values change
        values_ = std::make_unique<Resample>();
        values_->dtype = dtype;
        values_->bytes_per_voxel = bytes_per_voxel;
        values_->dist = dist;
        values_->voxel_mapping = voxel_mapping;
        Header const grid_header = plan.output;
        plan.output = values_->plan({&grid_header, 1}).output;
        if (!plan.error.exact())
            plan.error.magnitude = std::max(plan.error.magnitude, storing_error(plan.output.dtype));
    }
    // A reconstruction is a definition: its weights are positive and sum to 1.
    auto values = values_read(input, plan);
    if (values) values = values->with(input.values.physical(stored_background_));
    plan.passing = mask ? ErrorPassing::moved(ValueInterval{0, 1}) : ErrorPassing::averaged(1, values);
    if (mask) plan.passing.gain = {0};
    checked(plan.output);
    return plan;
}

void Resample::take_tree(Volume input) {
    reconstructor_.emplace(std::move(input), grid_, reconstruction(), stored_background_);
}

bool Resample::runs_from_tree_on_gpu() const { return !mask && DeviceSampler::computes(reconstruction(), tree_type_); }

void Resample::reconstruct_tree(AnyView out, Execution const& execution) {
    if (!mask && !values_) return reconstructor_->run(out, execution);
    DataType const type = reconstructor_->header().dtype;
    samples_.reserve(static_cast<std::size_t>(out.box.voxels()) * size_of(type));
    AnyView const samples = dense_view(samples_.write(out.space), type, out.box, out.space);
    if (mask) return reconstructor_->run(samples, out, execution);
    reconstructor_->run(samples, execution);
    ConstView const from = samples;
    values_->run({&from, 1}, out, execution);
}

std::string Resample::describe() const {
    std::string result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        result += text(axis == 0 ? "" : ", ", name_of(tables_[axis].kernel()));
    }
    if (algorithm_ == Algorithm::copy) return "copy";
    if (algorithm_ == Algorithm::convert) return "rounded half to even, saturated";
    return algorithm_ == Algorithm::halving ? result + " (halving)" : result;
}

Box Resample::footprint(Box const& output, int) const {
    if (from_tree_) return {};
    if (onto_) return onto_->footprint(output);
    Box result;
    for (int axis = 0; axis < 3; ++axis) {
        auto const range = tables_[static_cast<std::size_t>(axis)].footprint(output.lower[axis], output.upper[axis]);
        result.lower[axis] = range.first;
        result.upper[axis] = range.second;
    }
    return result;
}

std::size_t Resample::fit(Index3 largest, Execution const& execution) {
    if (from_tree_ || execution.device == Device::gpu) return 0;
    if (onto_) return onto_->fit(largest, execution);
    if (algorithm_ != Algorithm::weighted && algorithm_ != Algorithm::whole) return 0;
    Box const part = box_of(largest), in = footprint(part, 0);
    std::int64_t const threads = VKT_BACKEND::threads_for(execution, std::max(in.voxels(), part.voxels()));
    std::int64_t const of_sum = algorithm_ == Algorithm::whole ? sizeof(Int128) : sizeof(double);
    return static_cast<std::size_t>(threads * bytes_of_sums(in.dims().x, largest.x, tables_[0].most_taps(), of_sum));
}

void Resample::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    if (out.box.empty()) return;
    if (from_tree_) return reconstruct_tree(out, execution);
    ConstView const in = inputs.front();
    if (onto_) {
        Losses losses;
        onto_->run(in, out, losses, execution);
        counts_.clipped += losses.clipped;
        counts_.nan += losses.nan;
        return;
    }
    if (algorithm_ == Algorithm::copy) return copy_region(in.part(out.box), out, execution);
    if (algorithm_ == Algorithm::halving) {
        Index3 const factors{tables_[0].halving(), tables_[1].halving(), tables_[2].halving()};
        return resample_halved(in, out, factors, execution);
    }
    Losses losses;
    auto const count = [&] {
        counts_.clipped += losses.clipped;
        counts_.nan += losses.nan;
    };
    if (algorithm_ == Algorithm::convert) {
        convert_values(in.part(out.box), out, losses, execution);
        return count();
    }
    WeightedSum sum = weighted_sum(tables_, in.type, execution.space());
    if (algorithm_ == Algorithm::nearest) return resample_nearest(in, out, sum, execution);
    sum.border = border_;
    if (algorithm_ == Algorithm::whole) return resample_whole(in, out, sum, execution);
    sum.scale = scale_value_;
    sum.offset = offset_value_;
    resample_weighted(in, out, sum, scratch_, losses, execution);
    count();
}

std::vector<std::int64_t*> Resample::counters() {
    auto all = counts_.counters();
    if (onto_) all.push_back(onto_->outside_counter());
    return all;
}

std::vector<Remark> Resample::remarks() const {
    if (from_tree_) return values_ ? values_->remarks() : std::vector<Remark>{};
    std::int64_t const voxels = to_.x * to_.y * to_.z;
    std::vector<Remark> result = store_remarks(counts_, voxels, out_type_);
    if (choice_) result.push_back(choice_->remark(*tolerance));
    if (onto_ && onto_->outside() > 0)
        result.push_back({text(share_text(onto_->outside(), voxels), " outside the input: background"), false});
    return result;
}

} // namespace vkt
