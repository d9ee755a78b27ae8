// Transform: types, precision, place in the world, and what lies outside the region.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/transform.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/common/same_grid.h"
#include "libvkt/operations/voxels/arithmetic.h"
#include "libvkt/operations/voxels/kernels/transform.h"

#include <cmath>

namespace vkt {

VKT_OPERATION(Transform, "transform")

namespace {

bool is_small(DataType type) { return size_of(type) <= 2 || type == DataType::float32; }

/// Yields fractions of whole numbers: the functions, but not a quotient, which arith rounds too.
bool is_function(Op op) {
    return (op >= Op::sqrt && op <= Op::atan) || op == Op::pow || op == Op::atan2 || op == Op::hypot || is_world(op);
}

bool is_exact(Op op) {
    return operands_of(op) == 0 || is_predicate(op) || op == Op::neg || op == Op::abs ||
           (op >= Op::floor && op <= Op::sign) || op == Op::min || op == Op::max || op == Op::fmod ||
           op == Op::select || op == Op::clamp;
}

bool has_neighbours(Expression const& expression) {
    return expression.any([](Node const& node) { return node.op == Op::voxel && !(node.offset == Index3{}); });
}

/// What the values of a node are made of; what only decides, a comparison or the condition of a choice, does not count.
struct Origin {
    bool function = false;
    unsigned volumes = 0;
};

Origin origin_of(Expression const& expression) {
    std::vector<Origin> of;
    for (Node const& node : expression.nodes()) {
        Origin own{is_function(node.op), node.op == Op::voxel ? 1U << static_cast<unsigned>(node.volume) : 0U};
        if (!is_predicate(node.op))
            for (std::size_t k = node.op == Op::select ? 1 : 0; k < 3; ++k) {
                if (node.in[k] < 0) continue;
                Origin const& in = of[static_cast<std::size_t>(node.in[k])];
                own.function = own.function || in.function;
                own.volumes |= in.volumes;
            }
        of.push_back(own);
    }
    return of.back();
}

Values stored_values(Header const& header) {
    if (!is_integer(header.dtype) || !(header.values == ValueMap{})) return {false, -HUGE_VAL, HUGE_VAL};
    return {true, lowest_of(header.dtype), highest_of(header.dtype)};
}

} // namespace

/// Positions in trees may be halves; those of a level whose cells are one wide are not.
std::vector<Values> Transform::values(Place const& place, Expression const& parsed, bool whole) const {
    std::vector<Values> volumes, positions;
    for (Header const& header : place.inputs) volumes.push_back(stored_values(header));
    for (int axis = 0; axis < 3; ++axis)
        positions.push_back({whole, 0, static_cast<double>(place.inputs[0].dims[axis] * place.cell_width[axis] - 1)});
    return vkt::values_of(parsed, volumes, positions);
}

Texts Transform::texts() const {
    return {
        "Compute an expression for every voxel.",
        "The expression names voxels of the inputs (v, then a, b, c, d, f, g, h), neighbours of them (v[-1,0,0]), "
        "positions (x y z, extents nx ny nz, in the world wx wy wz), pi, e, nan, inf, + - * / ^, comparisons, "
        "and or not, C ? A : B, and abs min max clamp sqrt cbrt exp exp2 log log2 log10 pow sin cos tan asin acos atan "
        "atan2 sinh cosh tanh erf floor ceil round trunc fract fmod mod hypot sign step select lerp xor isnan isinf "
        "isfinite. Values are physical. What is clipped, "
        "undefined or not a number is counted and reported."
        "\n\n"
        "Accuracy: Whole numbers below 2^53 are exact; other expressions are computed step by step, functions to 4 "
        "units in the last place of double precision, and what that makes of values that cancel is not bounded.",
        {{"Scale and shift", "vkt transform 'v * 2 + 1' volume.nrrd | vkt stats"},
         {"A difference along x",
          "vkt transform '(v[1,0,0] - v[-1,0,0]) / 2' volume.nrrd --boundary clamp | vkt stats"},
         {"Keep a ball", "vkt transform 'hypot(hypot(x-32, y-32), z-32) < 20 ? v : 0' volume.nrrd -o ball.nrrd"},
         {"Two volumes", "vkt filter gaussian volume.nrrd --sigma 2 | vkt transform 'a > v ? a : 0' - volume.nrrd "
                         "| vkt stats"}}};
}

void Transform::parameters(Parameters& parameters) {
    parameters.positional("expression", expression, "what each voxel becomes, for example 'v * 2 + 1'");
    parameters.option("dtype", dtype, "TYPE", "data type of the result");
    parameters.option("boundary", boundary_, "RULE",
                      "how volumes continue outside, for neighbours (default mirror): mirror, clamp, wrap, "
                      "border[:VALUE]");
    parameters.option("roi", region_, "REGION", "compute only the voxels of this region");
}

std::vector<Knob> Transform::knobs() const { return {type_knob()}; }

void Transform::check() const {
    Expression const parsed = Expression::parse(expression);
    if (boundary_ && !has_neighbours(parsed))
        throw Error(ErrorKind::usage, "--boundary: the expression looks at no neighbours",
                    "these are written v[1,0,0]");
    if (boundary_ && !std::isfinite(boundary_->value))
        throw Error(ErrorKind::usage, "--boundary border: the value is not a finite number");
}

Shape Transform::shape() const {
    if (expression.empty()) return Shape::neighbourhood; // nothing is said yet
    if (begun_shape_) return *begun_shape_;
    return has_neighbours(Expression::parse(expression)) ? Shape::neighbourhood : Shape::pointwise;
}

int Transform::inputs() const {
    return expression.empty() ? static_cast<int>(volume_letters.size()) : Expression::parse(expression).volumes();
}

/// The type of the result, and its value map.
void Transform::choose_type(Place const& place, Expression const& parsed, Header& output) const {
    auto const& inputs = place.inputs;
    Origin const origin = origin_of(parsed);
    if (!region_.empty()) { // all else stays what it is
        if (dtype) output.dtype = *dtype;
        return;
    }
    std::vector<Header const*> volumes;
    for (std::size_t i = 0; i < inputs.size(); ++i)
        if ((origin.volumes >> i & 1U) != 0) volumes.push_back(&inputs[i]);
    bool same_map = true, small = true;
    for (Header const* header : volumes) {
        same_map = same_map && header->values == volumes.front()->values;
        small = small && is_small(header->dtype);
    }
    if (volumes.empty()) {
        output.dtype = DataType::float64;
        output.values = {};
        output.units.clear();
        Values const own = values(place, parsed, inputs[0].kind == Kind::structured && !place.on_level).back();
        for (DataType const type : {DataType::int64, DataType::int32, DataType::uint32, DataType::int16,
                                    DataType::uint16, DataType::int8, DataType::uint8})
            if (own.whole && std::abs(own.low) <= 0x1p53 && std::abs(own.high) <= 0x1p53 &&
                own.low >= lowest_of(type) && own.high <= highest_of(type))
                output.dtype = type;
    } else if (origin.function || !same_map) {
        output.dtype = small ? DataType::float32 : DataType::float64;
        output.values = {};
        output.units.clear();
    } else {
        output.dtype = volumes.front()->dtype;
        output.values = volumes.front()->values;
        for (Header const* header : volumes) output.dtype = promoted(output.dtype, header->dtype);
    }
    if (dtype) output.dtype = *dtype;
}

/// True if float32 is as good as float64 for this result.
bool Transform::fits_float(Place const& place, Expression const& parsed, Header const& output) const {
    constexpr double most = 0x1p24; // whole numbers up to here are floats
    if (!is_small(output.dtype) || !(output.values == ValueMap{})) return false;
    std::vector<Values> const of = values(place, parsed, place.whole_positions());
    for (std::size_t i = 0; i < of.size(); ++i) {
        Node const& node = parsed.nodes()[i];
        if (is_world(node.op)) return false;
        if (node.op == Op::voxel) {
            Header const& header = place.inputs[static_cast<std::size_t>(node.volume)];
            if (!is_small(header.dtype) || !(header.values == ValueMap{})) return false;
        }
        if (is_position(node.op) && of[i].high > most) return false;
        if (is_integer(output.dtype) && !of[i].whole) return false;
        if (of[i].whole && of[i].bounded() && std::max(-of[i].low, of[i].high) > most) return false;
    }
    return true;
}

/// Outside of the volume there is one value for all inputs, stored in each one's type.
void Transform::choose_border(std::span<Header const> inputs, Expression const& parsed, Plan& plan) const {
    BoundaryRule const rule = boundary_.value_or(BoundaryRule{Boundary::mirror, 0});
    plan.boundary = rule.boundary;
    if (rule.boundary != Boundary::border) return;
    bool first = true;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        if (offsets_of(parsed, static_cast<int>(i)) == Box{}) continue;
        Header const& in = inputs[i];
        double const stored = in.values.stored(rule.value);
        bool const held = is_integer(in.dtype) ? stored >= lowest_of(in.dtype) && stored <= highest_of(in.dtype) &&
                                                     stored == std::nearbyint(stored)
                                               : std::abs(stored) <= highest_of(in.dtype);
        if (!held)
            throw Error(ErrorKind::usage,
                        text("--boundary border:", rule.value, " is no voxel of a ", in.dtype, " volume",
                             in.values == ValueMap{} ? "" : " with this value map"),
                        "convert the volume first: vkt convert --dtype float32");
        if (!first && stored != plan.border_value)
            throw Error(ErrorKind::usage, "--boundary border: the volumes store that value differently",
                        "convert them first: vkt convert --dtype float32");
        plan.border_value = stored;
        first = false;
    }
}

Plan Transform::plan_for(Place const& place, Expression const& parsed) const {
    require_same_grid(place.inputs);
    static_cast<void>(LevelRegion(region_, place.inputs[0])); // or it is refused
    Plan plan;
    plan.output = place.inputs[0];
    choose_type(place, parsed, plan.output);
    choose_border(place.inputs, parsed, plan);
    bool const in_float = fits_float(place, parsed, plan.output);
    std::size_t const operations = compile(parsed).per_voxel.size();
    plan.method = text(in_float ? "float32, " : "float64, ", static_cast<std::uint64_t>(operations),
                       operations == 1 ? " operation" : " operations");
    plan.cost = 0;
    std::vector<Values> const of = values(place, parsed, place.whole_positions());
    double const digits = in_float ? 0x1p24 : 0x1p53;
    for (std::size_t i = 0; i < of.size(); ++i) {
        Node const& node = parsed.nodes()[i];
        plan.cost += !is_function(node.op) ? 1 : node.op == Op::sqrt ? 3 : 20;
        bool const whole = of[i].whole && std::max(-of[i].low, of[i].high) <= digits &&
                           (node.op == Op::add || node.op == Op::sub || node.op == Op::mul || node.op == Op::mod);
        // What several roundings make of values that cancel is not known.
        if (!is_exact(node.op) && !whole) plan.error = ErrorBound::none_known();
    }
    if (!(plan.output.values == ValueMap{})) plan.error = ErrorBound::none_known();
    return plan;
}

Plan Transform::plan(std::span<Header const> inputs) const {
    Expression const parsed = Expression::parse(expression);
    if (static_cast<int>(inputs.size()) != parsed.volumes())
        throw Error(ErrorKind::usage,
                    text("the expression names ", parsed.volumes(), parsed.volumes() == 1 ? " volume" : " volumes",
                         "; ", static_cast<std::uint64_t>(inputs.size()), " are given"),
                    "the first is v, those that follow a, b, c, d, f, g, h");
    return plan_for({inputs}, parsed.with_extent(inputs[0].dims));
}

Plan Transform::plan_level(Header const& level, Index3 cell_width) const {
    Expression const parsed = Expression::parse(expression);
    char const* const hint = "make it a grid first: vkt resample --cells 50M";
    if (!region_.empty())
        throw Error(ErrorKind::usage, "transform --roi with neighbours works on structured volumes only", hint);
    if (parsed.any([](Node const& node) { return is_extent(node.op); }))
        throw Error(ErrorKind::usage, "nx, ny and nz beside neighbours have no meaning on a hierarchical volume", hint);
    return plan_for({{&level, 1}, true, cell_width}, parsed);
}

void Transform::begin(std::span<Header const> inputs, Plan const& plan) {
    begin_for({inputs}, Expression::parse(expression).with_extent(inputs[0].dims), plan);
}

void Transform::begin_level(Header const& level, Index3 cell_width, Plan const& plan) {
    begin_for({{&level, 1}, true, cell_width}, Expression::parse(expression), plan);
}

void Transform::begin_for(Place const& place, Expression const& parsed, Plan const& plan) {
    Header const& first = place.inputs[0];
    begun_shape_ = has_neighbours(parsed) ? Shape::neighbourhood : Shape::pointwise;
    planned_ = plan.output;
    losses_ = {};
    maps_.clear();
    reach_.clear();
    for (std::size_t i = 0; i < place.inputs.size(); ++i) {
        maps_.push_back(place.inputs[i].values);
        reach_.push_back(offsets_of(parsed, static_cast<int>(i)));
    }
    in_float_ = fits_float(place, parsed, plan.output);
    counts_undefined_ = !is_integer(plan.output.dtype) && !parsed.says_infinite();
    program_ = compile(parsed);
    geometry_ = first.geometry;
    on_level_ = place.on_level;
    inside_ = {region_, first};
    enter_level({1, 1, 1}, {0, 0, 0});
}

void Transform::enter_level(Index3 cell_width, Index3 first) {
    inside_.enter_level(cell_width, first);
    Vec3 centre;
    for (int axis = 0; axis < 3; ++axis) {
        auto const width = static_cast<double>(cell_width[axis]);
        place_.step[axis] = width;
        place_.first[axis] = static_cast<double>(first[axis]) + 0.5 * (width - 1);
        centre[axis] = place_.first[axis];
        // Positions beyond this are no floats: where a level lies is told here first.
        if (on_level_ && program_.positions && !(std::abs(place_.first[axis]) < 0x1p23)) in_float_ = false;
        // A level's geometry is that of its cells.
        double const spacing = geometry_.spacing[axis] * (on_level_ ? 1 : width);
        auto const a = static_cast<std::size_t>(axis);
        place_.column[a] = geometry_.direction[a] * spacing;
    }
    place_.origin = on_level_ ? geometry_.origin : index_to_world(geometry_, centre);
}

Box Transform::footprint(Box const& output, int input) const {
    Box const& reach = reach_[static_cast<std::size_t>(input)];
    return {output.lower + reach.lower, output.upper + reach.upper};
}

std::size_t Transform::fit(Index3, Execution const& execution) {
    return program_.workspace(in_float_ ? sizeof(float) : sizeof(double)) *
           static_cast<std::size_t>(std::max(1, execution.threads));
}

void Transform::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = inside_.part_of(out.box);
    if (!(inside == out.box)) {
        ConstView const from = inputs[0].part(out.box);
        if (from.type == out.type)
            copy_region(from, out, execution);
        else
            convert_values(from, out, losses_.losses, execution);
    }
    if (inside.empty()) return;
    TransformTask task;
    task.program = &program_;
    task.in_float = in_float_;
    task.place = place_;
    task.maps = maps_;
    task.result = planned_.values;
    task.counts_undefined = counts_undefined_;
    task.workspace_bytes = program_.workspace(in_float_ ? sizeof(float) : sizeof(double));
    constexpr std::size_t line = 64;
    workspace_.resize(task.workspace_bytes * static_cast<std::size_t>(std::max(1, execution.threads)) + line);
    task.workspace = workspace_.data() + (line - reinterpret_cast<std::uintptr_t>(workspace_.data()) % line) % line;
    transform_voxels(task, inputs, out.part(inside), losses_, execution);
}

std::vector<Remark> Transform::remarks() const {
    std::int64_t const voxels = planned_.voxels();
    std::vector<Remark> result = store_remarks(losses_.losses, voxels, planned_.dtype);
    if (losses_.losses.undefined > 0)
        result.push_back(
            {text(share_text(losses_.losses.undefined, voxels), " undefined: not finite where the volumes are"), true});
    if (losses_.inexact > 0)
        result.push_back({text(share_text(losses_.inexact, voxels),
                               " of 2^53 or more, computed with 53 bits; vkt arith is exact there"),
                          true});
    return result;
}

} // namespace vkt
