// Resample: what is asked for, which tables that needs, and which kernel does it.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/resample.h"

#include "libvkt/core/fine_region.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/wide.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/formats/format.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/resample/kernels/resample.h"

#include <algorithm>
#include <cmath>

namespace vkt {

VKT_OPERATION(Resample, "resample")

Texts Resample::texts() const {
    return {
        "Resample a volume to another number of voxels, or onto another's grid.",
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
        "Accuracy: nearest is exact. Of integers linear and area come out as in exact arithmetic, rounded once, unless "
        "a part of the volume or another grid is asked for, whose positions are rounded; floats are bounded by (n + "
        "12) 2^-53 of the largest magnitude for n voxels that are summed, plus the "
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
             "auto (default): area average where an axis shrinks, linear where it grows; or nearest, linear, area, "
             "cubic, bspline3, bspline5, lanczos3; hierarchical volumes: basis (default), nearest, average, or auto: "
             "average where a voxel covers several cells or there are holes");
    p.option(
        "tolerance", tolerance, "T|P%",
        "choose the cheapest of nearest, linear, cubic and lanczos3 whose estimated error is at most T, a physical "
        "value, or P% of the value range, after a look at the voxels; axes that shrink are averaged, the type stays");
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
    Index3 const from = layout_.from, to = layout_.to;
    bool const shrinks = to.x < from.x || to.y < from.y || to.z < from.z;
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

ResampleKernel Resample::kernel_of(Layout const& layout, int axis) const {
    double const width = static_cast<double>(layout.from[axis]) / static_cast<double>(layout.to[axis]);
    // An estimate says what lies between voxels, not what several of them amount to.
    return kernel_for(layout.chosen && width > 1 ? ResampleMethod::automatic : used(layout), width);
}

/// The grid of --like, as its own header has it.
void Resample::take_grid(Header const& input, Header& output) const {
    Header const& like = like_.header();
    output.geometry = like.geometry;
    take_world(like, output);
    if (!(like.dims == input.dims && same_place(like, input))) output.part.reset();
}

/// `moves`: no value is interpolated.
void Resample::choose_header(Header const& input, bool moves, Layout& layout) const {
    Header& output = layout.output;
    output = input;
    output.dims = layout.to;
    output.geometry = rescaled(input.geometry, layout.from, layout.to);
    if (!(layout.from == layout.to)) output.part.reset();
    if (!like_.file.empty()) take_grid(input, output);
    if (auto const& map = layout.region_map) {
        output.part.reset();
        output.geometry = input.geometry;
        output.geometry.origin = index_to_world(input.geometry, map->offset);
        for (int a = 0; a < 3; ++a) output.geometry.spacing[a] *= map->column[static_cast<std::size_t>(a)][a];
    }
    if (dist) output.geometry.spacing = *dist;
    bool const lobes = !tolerance && has_lobes(used(layout)) && !moves;
    if (lobes && is_integer(input.dtype) && !is_signed(input.dtype))
        output.dtype = size_of(input.dtype) <= 2 ? DataType::float32 : DataType::float64;
    if (bytes_per_voxel && size_of(output.dtype) != size_of(type_of_bytes(*bytes_per_voxel)))
        output.dtype = type_of_bytes(*bytes_per_voxel);
    if (dtype) output.dtype = *dtype;
    if (voxel_mapping) output.values = value_map_of(*voxel_mapping, output.dtype);
    check_wanted(output);
    if (output.values == input.values) return;
    layout.scale_value = input.values.slope / output.values.slope;
    layout.offset_value = (input.values.intercept - output.values.intercept) / output.values.slope;
}

Plan Resample::plan(std::span<Header const> inputs) const {
    Header const& input = inputs.front();
    if (input.kind == Kind::hierarchical) return plan_tree(input);
    Beginning const first = beginning(input);
    Plan plan = plan_of(input, first.layout);
    if (first.choice) first.choice->announce(plan);
    return plan;
}

void Resample::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs.front();
    counts_ = {};
    reconstructor_.reset();
    values_.reset();
    layout_ = {};
    choice_.reset();
    preparation_ = nullptr;
    from_tree_ = input_.kind == Kind::hierarchical;
    if (from_tree_) return begin_tree(input_);
    Beginning first = beginning(input_);
    layout_ = std::move(first.layout);
    choice_ = std::move(first.choice);
    coarser_ = first.coarser;
    if (layout_.onto) preparation_ = layout_.onto->take_coefficients();
}

Resample::Beginning Resample::beginning(Header const& input) const {
    refuse_tree_options();
    Beginning first;
    if (!tolerance) {
        first.layout = layout_for(input, {});
        return first;
    }
    // Of what may be chosen the last one looks furthest.
    Layout& layout = first.layout = layout_for(input, InterpolationChoice::candidates.back());
    ErrorPassing::Storing const storing = plan_of(input, layout).passing.storing;
    if (storing == ErrorPassing::Storing::moves || storing == ErrorPassing::Storing::converts) return first;
    Placement const placement =
        layout.onto ? layout.onto->placement() : place(layout.output.geometry, layout.to, input.geometry);
    first.coarser = placement.coarser();
    std::array<bool, 3> axes = placement.between();
    for (int a = 0; a < 3 && !layout.onto; ++a) axes[static_cast<std::size_t>(a)] = layout.to[a] > layout.from[a];
    if (std::ranges::none_of(axes, [](bool between) { return between; })) // averages and copies alone
        layout = layout_for(input, ResampleMethod::automatic);
    else
        first.choice.emplace(input, box_of(input.dims), axes, *tolerance);
    return first;
}

void Resample::scan(ConstView slab, Execution const&) { choice_->scan(slab); }

void Resample::scan_end() {
    layout_ = layout_for(input_, choice_->choose(coarser_));
    plan_of_chosen_ = plan_of(input_, layout_);
}

void Resample::after_scan(Plan& plan) const {
    if (choice_) choice_->settle(plan_of_chosen_, plan);
}

/// `chosen`: instead of the method.
Resample::Layout Resample::layout_for(Header const& input, std::optional<ResampleMethod> chosen) const {
    if (!scale && !dims && !spacing && like_.file.empty() && !cells && !changes_values() && roi.empty())
        throw Error(ErrorKind::usage, "no new size is given", "say for example --scale 0.5 or --dims 128 128 64");
    Layout layout;
    layout.chosen = chosen;
    layout.from = input.dims;
    bool const part = !roi.empty() && !takes_all(roi, input.dims);
    if (part) {
        lay_region(input, layout);
        return layout;
    }
    layout.to = target_dims(input);
    if (!like_.file.empty()) {
        Geometry const grid = geometry_beside(input, like_.header());
        bool const same = layout.to == layout.from && same_geometry(grid, input.geometry);
        Placement const placement = place(grid, layout.to, input.geometry);
        if (!same && !placement.keeps_extent(layout.from, layout.to)) {
            lay_onto(input, placement, layout);
            return layout;
        }
    }
    lay_tables(input, layout);
    return layout;
}

/// Every axis on its own.
void Resample::lay_tables(Header const& input, Layout& layout) const {
    choose_header(input, layout.from == layout.to, layout);
    BoundaryRule const rule = boundary.value_or(BoundaryRule{});
    layout.border = rule.boundary == Boundary::border ? input.values.stored(rule.value) : 0;
    Index3 halving{};
    bool all_nearest = true;
    for (int axis = 0; axis < 3; ++axis) {
        WeightTable& table = layout.tables[static_cast<std::size_t>(axis)];
        table = WeightTable(layout.from[axis], layout.to[axis], kernel_of(layout, axis), rule.boundary);
        halving[axis] = table.halving();
        all_nearest =
            all_nearest && (table.kernel() == ResampleKernel::nearest || table.kernel() == ResampleKernel::identity);
    }
    bool const same_size = layout.from == layout.to;
    bool const same_values = layout.same_map() && layout.output.dtype == input.dtype;
    layout.algorithm = Algorithm::weighted;
    if (same_values && same_size)
        layout.algorithm = Algorithm::copy;
    else if (layout.same_map() && same_size)
        layout.algorithm = Algorithm::convert;
    else if (same_values && all_nearest)
        layout.algorithm = Algorithm::nearest;
    else if (same_values && halving.x * halving.y * halving.z > 1)
        layout.algorithm = Algorithm::halving;
    else if (same_values && sums_in_integers(input.dtype, layout))
        layout.algorithm = Algorithm::whole;
}

Plan Resample::plan_of(Header const& input, Layout const& layout) const {
    Plan plan;
    plan.output = layout.output;
    if (layout.onto) {
        layout.onto->describe(plan);
        layout.onto->pass(input, plan);
        return plan;
    }
    auto const& tables = layout.tables;
    Algorithm const algorithm = layout.algorithm;
    plan.boundary = boundary.value_or(BoundaryRule{}).boundary;
    plan.border_value = layout.border;
    for (WeightTable const& table : tables) plan.state_bytes += table.bytes();
    if (algorithm == Algorithm::copy) plan.shift = Index3{};
    plan.method = describe(layout);
    plan.error = error_of(input, layout);
    plan.passing =
        ErrorPassing::averaged(tables[0].gain() * tables[1].gain() * tables[2].gain(), values_read(input, plan));
    if (algorithm == Algorithm::copy || algorithm == Algorithm::nearest)
        plan.passing.storing = ErrorPassing::Storing::moves;
    if (algorithm == Algorithm::convert) plan.passing.storing = ErrorPassing::Storing::converts;
    bool const moves =
        algorithm == Algorithm::copy || algorithm == Algorithm::convert || algorithm == Algorithm::nearest;
    plan.cost = moves ? 0 : multiply_adds(tables);
    return plan;
}

/// Of the arithmetic only: how well an interpolant represents what was sampled depends on the data.
ErrorBound Resample::error_of(Header const& input, Layout const& layout) const {
    Header const& output = layout.output;
    auto const& tables = layout.tables;
    Algorithm const algorithm = layout.algorithm;
    ErrorBound error;
    if (algorithm == Algorithm::copy || algorithm == Algorithm::convert || algorithm == Algorithm::nearest ||
        algorithm == Algorithm::whole)
        return error;
    if (algorithm == Algorithm::halving && is_integer(input.dtype)) return error;
    if (algorithm == Algorithm::weighted && layout.same_map() && sums_exactly(input.dtype, layout)) return error;
    error.kind = ErrorBound::Kind::bound;
    double const slope = std::abs(input.values.slope);
    if (algorithm == Algorithm::halving) { // three additions, in float32 for float16
        bool const half = input.dtype == DataType::float16;
        DataType const sums = half ? DataType::float32 : input.dtype;
        error.magnitude = 3 * storing_error(sums) + (half ? storing_error(input.dtype) : 0);
        error.absolute = slope * (8 * storing_floor(sums) + (half ? storing_floor(input.dtype) : 0));
        return error;
    }
    // A product and an addition for each row and each column, and a dozen roundings of weights, divisors, 64-bit
    // integers, the border's part and the quotient.
    auto const rows = static_cast<double>(tables[1].most_taps() * tables[2].most_taps());
    auto const columns = static_cast<double>(tables[0].most_taps());
    double const gain = tables[0].gain() * tables[1].gain() * tables[2].gain();
    error.magnitude = gain * ((rows + columns + 12) * 0x1p-53 + storing_error(output.dtype));
    error.absolute = slope * rows * columns * tables[0].divisor() * 0x1p-1070 +
                     std::abs(output.values.slope) * storing_floor(output.dtype);
    // What splines leave out sums to 0 along each axis, so that half of it meets the lowest value, half the highest.
    for (auto const& table : tables) error.range += 0.5 * table.cut() * gain / table.gain();
    if (!layout.same_map()) {
        error.magnitude += gain * 4 * 0x1p-53;
        error.absolute += (4 * 0x1p-53 + storing_error(output.dtype)) *
                          (std::abs(input.values.intercept) + std::abs(output.values.intercept));
    }
    bool const border = tables[0].leaves_out() || tables[1].leaves_out() || tables[2].leaves_out();
    error.limit(input.dtype, slope, border ? std::optional(layout.border) : std::nullopt);
    return error;
}

/// The background as a volume stores it: the one that was asked for, or that the volume names, or 0, which trees that
/// have no holes need no room for.
double Resample::background_in(Header const& volume) const {
    std::optional<double> const named = background ? volume.values.stored(*background) : stored_background(volume);
    double const stored = named.value_or(volume.values.stored(0));
    bool const fits =
        !is_integer(volume.dtype) || (stored >= lowest_of(volume.dtype) && stored <= highest_of(volume.dtype));
    bool const tree = volume.kind == Kind::hierarchical;
    if (!fits && (named || !tree))
        throw Error(ErrorKind::usage,
                    text("the background ", volume.values.physical(stored), " cannot be stored in ", volume.dtype),
                    tree ? "choose another --background" : "choose another --background, or a type with --dtype");
    return stored;
}

/// True if a region is the whole volume.
bool Resample::takes_all(Roi const& roi, Index3 dims) {
    FineRegion const region = resolve_fine(roi, dims);
    for (int a = 0; a < 3; ++a)
        if (region.lower[a] != 0 || region.upper[a] != static_cast<double>(dims[a])) return false;
    return true;
}

/// The outer faces of the result are the ends of the region.
void Resample::lay_region(Header const& input, Layout& layout) const {
    FineRegion const region = resolve_fine(roi, input.dims);
    Vec3 const extent = region.upper - region.lower;
    Header part = input;
    for (int a = 0; a < 3; ++a) part.dims[a] = rounded_extent(extent[a]);
    layout.to = target_dims(part, extent);
    Affine& map = layout.region_map.emplace();
    for (int a = 0; a < 3; ++a) {
        double const width = extent[a] / static_cast<double>(layout.to[a]);
        map.column[static_cast<std::size_t>(a)][a] = width;
        map.offset[a] = region.lower[a] + 0.5 * (width - 1);
    }
    lay_onto(input, place(map, layout.to), layout);
}

void Resample::lay_onto(Header const& input, Placement const& placement, Layout& layout) const {
    choose_header(input, placement.whole(), layout);
    OntoValues values{input.dtype, layout.output.dtype, layout.scale_value, layout.offset_value};
    if (boundary)
        values.border = input.values.stored(boundary->value);
    else
        values.background = background_in(layout.output);
    // No voxel of a region lies outside, however near to a face: the voxels there go on.
    bool const inside = like_.file.empty() && !boundary && !placement.whole();
    layout.onto.emplace(placement, layout.from, layout.to, used(layout), inside ? BoundaryRule{} : boundary, values);
}

/// True if integers come out as by exact arithmetic, rounded once: no sum of whole weights times values, and no
/// distance of a quotient from a tie, is beyond double.
bool Resample::sums_exactly(DataType input, Layout const& layout) const {
    if (!is_integer(input) || has_lobes(used(layout))) return false;
    auto const& tables = layout.tables;
    double const divisor = tables[0].divisor() * tables[1].divisor() * tables[2].divisor(), border = layout.border;
    bool const rounds_once = is_integer(layout.output.dtype) || layout.output.dtype == DataType::float64;
    double const largest = std::max(std::exp2(8 * static_cast<double>(size_of(input))), std::abs(border));
    return rounds_once && border == std::rint(border) && largest * divisor <= 0x1p52;
}

/// True for 64-bit integers, of which double would lose digits, where 128 bits hold every sum of weights times values
/// and the border is one of the values.
bool Resample::sums_in_integers(DataType input, Layout const& layout) const {
    if (!is_integer(input) || size_of(input) != 8 || has_lobes(used(layout))) return false;
    auto const& tables = layout.tables;
    double const divisor = tables[0].divisor() * tables[1].divisor() * tables[2].divisor(), border = layout.border;
    bool const inside = border >= lowest_of(input) && border < highest_of(input);
    return inside && border == std::rint(border) && divisor <= 0x1p62;
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

std::string Resample::describe(Layout const& layout) {
    std::string result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        result += text(axis == 0 ? "" : ", ", name_of(layout.tables[axis].kernel()));
    }
    if (layout.algorithm == Algorithm::copy) return "copy";
    if (layout.algorithm == Algorithm::convert) return "rounded half to even, saturated";
    return layout.algorithm == Algorithm::halving ? result + " (halving)" : result;
}

Box Resample::footprint(Box const& output, int) const {
    if (from_tree_) return {};
    if (layout_.onto) return layout_.onto->footprint(output);
    Box result;
    for (int axis = 0; axis < 3; ++axis) {
        WeightTable const& table = layout_.tables[static_cast<std::size_t>(axis)];
        std::int64_t const begin = output.lower[axis], end = output.upper[axis];
        auto const range = axis == 2 ? table.footprint_forward(begin, end) : table.footprint(begin, end);
        result.lower[axis] = range.first;
        result.upper[axis] = range.second;
    }
    return result;
}

std::size_t Resample::fit(Index3 largest, Execution const& execution) {
    if (from_tree_ || execution.device == Device::gpu) return 0;
    if (layout_.onto) return layout_.onto->fit(largest, execution);
    if (layout_.algorithm != Algorithm::weighted && layout_.algorithm != Algorithm::whole) return 0;
    Box const part = box_of(largest), in = footprint(part, 0);
    std::int64_t const threads = VKT_BACKEND::threads_for(execution, std::max(in.voxels(), part.voxels()));
    std::int64_t const bytes =
        layout_.algorithm == Algorithm::whole
            ? bytes_of_sums(in.dims().x, largest.x, layout_.tables[0].most_taps(), sizeof(Int128))
            : SumTile(layout_.tables).bytes();
    return static_cast<std::size_t>(threads * bytes);
}

void Resample::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    if (out.box.empty()) return;
    if (from_tree_) return reconstruct_tree(out, execution);
    ConstView const in = inputs.front();
    if (layout_.onto) {
        Losses losses;
        layout_.onto->run(in, out, losses, execution);
        counts_.clipped += losses.clipped;
        counts_.nan += losses.nan;
        return;
    }
    if (layout_.algorithm == Algorithm::copy) return copy_region(in.part(out.box), out, execution);
    if (layout_.algorithm == Algorithm::halving) {
        Index3 const factors{layout_.tables[0].halving(), layout_.tables[1].halving(), layout_.tables[2].halving()};
        return resample_halved(in, out, factors, execution);
    }
    Losses losses;
    auto const count = [&] {
        counts_.clipped += losses.clipped;
        counts_.nan += losses.nan;
    };
    if (layout_.algorithm == Algorithm::convert) {
        convert_values(in.part(out.box), out, losses, execution);
        return count();
    }
    WeightedSum sum = weighted_sum(layout_.tables, in.type, execution.space());
    if (layout_.algorithm == Algorithm::nearest) return resample_nearest(in, out, sum, execution);
    sum.border = layout_.border;
    if (layout_.algorithm == Algorithm::whole) return resample_whole(in, out, sum, execution);
    sum.scale = layout_.scale_value;
    sum.offset = layout_.offset_value;
    resample_weighted(in, out, sum, scratch_, losses, execution);
    count();
}

std::vector<std::int64_t*> Resample::counters() {
    auto all = counts_.counters();
    if (layout_.onto) all.push_back(layout_.onto->outside_counter());
    return all;
}

std::vector<Remark> Resample::remarks() const {
    if (from_tree_) return values_ ? values_->remarks() : std::vector<Remark>{};
    std::int64_t const voxels = layout_.to.x * layout_.to.y * layout_.to.z;
    std::vector<Remark> result = store_remarks(counts_, voxels, layout_.output.dtype);
    if (choice_)
        if (auto const remark = choice_->remark()) result.push_back(*remark);
    if (layout_.onto && layout_.onto->outside() > 0)
        result.push_back({text(share_text(layout_.onto->outside(), voxels), " outside the input: background"), false});
    return result;
}

} // namespace vkt
