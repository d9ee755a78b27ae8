// Arithmetic: pieces of rows in float or double; voxels that this would round twice once more exactly. 64-bit integers
// among themselves in 128 bits.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/arithmetic.h"

#include "libvkt/core/frame.h"
#include "libvkt/operations/kernels/arithmetic.h"
#include "libvkt/core/wide.h"

#include <bit>
#include <cmath>
#include <limits>
#include <utility>

namespace vkt {

namespace {

std::optional<Number> as_number(std::string const& word) {
    if (word.empty() || word == "-") return std::nullopt;
    try {
        return Number::parse(word);
    } catch (Error const&) {
        return std::nullopt;
    }
}

bool is_wide(DataType type) { return is_integer(type) && size_of(type) == 8; }

/// A whole number of up to 64 bits that double does not hold.
bool is_inexact(Number const& number) {
    constexpr Int128 end = Int128{1} << 64;
    return number.whole && *number.whole > -end && *number.whole < end &&
           static_cast<Int128>(number.value) != *number.whole;
}

ExactNumber exact(Number const& number) {
    if (!std::isfinite(number.value)) return {};
    if (!is_inexact(number)) return ExactNumber::of(number.value);
    Int128 const size = *number.whole < 0 ? -*number.whole : *number.whole;
    return {*number.whole < 0, static_cast<std::uint64_t>(size), 0};
}

} // namespace

/// What is known of an operand's values: significant binary digits, and the exponents between which they lie.
struct Arithmetic::Operand {
    int digits = 53, lowest = -1074, highest = 1024;
    bool inexact = false; ///< double does not hold them

    static Operand of(Number const& number) {
        if (number.value == 0 || !std::isfinite(number.value)) return {1, 0, 1, false};
        ExactNumber const n = exact(number);
        int const zeros = std::countr_zero(n.bits), width = static_cast<int>(std::bit_width(n.bits));
        return {width - zeros, n.exponent + zeros, n.exponent + width, is_inexact(number)};
    }
    static Operand of(DataType type) {
        if (is_integer(type)) {
            int const bits = static_cast<int>(8 * size_of(type));
            return {bits, 0, bits, bits == 64};
        }
        if (type == DataType::float16) return {11, -24, 16, false};
        if (type == DataType::float32) return {24, -149, 128, false};
        return {};
    }
};

DataType promoted(DataType a, DataType b) {
    if (a == b) return a;
    if (is_integer(a) && is_integer(b)) {
        for (DataType const t : {DataType::uint8, DataType::int8, DataType::uint16, DataType::int16, DataType::uint32,
                                 DataType::int32, DataType::uint64})
            if (lowest_of(t) <= std::min(lowest_of(a), lowest_of(b)) &&
                highest_of(t) >= std::max(highest_of(a), highest_of(b)))
                return t;
        return DataType::int64;
    }
    DataType const f = is_integer(a) ? b : a, other = is_integer(a) ? a : b;
    if (!is_integer(other)) return std::max(f, other); // float16 < float32 < float64
    if (size_of(other) == 1) return f;
    return std::max(f, size_of(other) == 2 ? DataType::float32 : DataType::float64);
}

VKT_OPERATION(Arithmetic, "arith")

/// A single operand is the second one: the first comes from standard input.
std::array<std::string, 2> Arithmetic::both() const {
    if (b.empty()) return {"-", a};
    return {a, b};
}

std::vector<std::string> Arithmetic::operands() const {
    std::vector<std::string> result;
    for (auto const& operand : both())
        if (!operand.empty() && !as_number(operand)) result.push_back(operand);
    return result;
}

void Arithmetic::parameters(Parameters& p) {
    p.positional("op", op, "add, sub, mul, div, min or max");
    p.positional("a", a, "first operand: a volume ('-' is standard input) or a number");
    p.positional("b", b, "second operand: a volume or a number; if only one is given, the first is standard input")
        .optional();
    p.option("dtype", dtype, "TYPE", "data type of the result");
}

void Arithmetic::check() const {
    if (operands().empty())
        throw Error(ErrorKind::usage, text("both operands, ", a, " and ", b, ", are numbers"),
                    text("a file of that name is written ./", a));
}

/// Decides in which values to compute, and what the result is stored as.
void Arithmetic::choose_values(Header const& first, Header const* second, Header& output) {
    map_a_ = map_b_ = map_out_ = {};
    output.dtype = second == nullptr ? first.dtype : promoted(first.dtype, second->dtype);
    if (second == nullptr && !(first.values == ValueMap{})) { // a number is a physical value
        (number_a_ ? map_b_ : map_a_) = first.values;
        map_out_ = first.values;
    }
    if (second != nullptr && !(first.values == second->values)) {
        map_a_ = first.values;
        map_b_ = second->values;
        output.values = {};
        bool const small = size_of(first.dtype) <= 2 && size_of(second->dtype) <= 2;
        output.dtype = small || (first.dtype == DataType::float32 && second->dtype == DataType::float32)
                           ? DataType::float32
                           : DataType::float64;
    }
    if (dtype) output.dtype = *dtype;
    type_ = output.dtype;

    bool const stored = map_a_ == ValueMap{} && map_b_ == ValueMap{};
    auto const fits_float = [](std::optional<Number> const& v) {
        return !v || static_cast<double>(static_cast<float>(v->value)) == v->value;
    };
    auto const small_type = [](DataType t) { return size_of(t) <= 2 || t == DataType::float32; };
    bool const whole = (!number_a_ || number_a_->whole) && (!number_b_ || number_b_->whole);
    bool const integers = is_integer(first.dtype) && (second == nullptr || is_integer(second->dtype));
    bool const wide = is_wide(first.dtype) || (second != nullptr && is_wide(second->dtype)) || is_wide(type_);
    integers_ = integers && is_integer(type_);
    algorithm_ = Algorithm::in_double;
    if (stored && integers_ && wide && whole)
        algorithm_ = Algorithm::in_integers;
    else if (stored && small_type(first.dtype) && (second == nullptr || small_type(second->dtype)) &&
             small_type(type_) && fits_float(number_a_) && fits_float(number_b_))
        algorithm_ = Algorithm::in_float;
    Operand const u = number_a_ ? Operand::of(*number_a_) : Operand::of(first.dtype);
    Operand const v =
        number_b_ ? Operand::of(*number_b_) : Operand::of(second == nullptr ? first.dtype : second->dtype);
    settles_ = stored && algorithm_ != Algorithm::in_integers && rounds_twice(u, v);
}

/// True if rounding to the type of the computation first, and then to that of the result, may go wrong.
bool Arithmetic::rounds_twice(Operand const& u, Operand const& v) const {
    if (u.inexact || v.inexact) return true;
    bool const single = algorithm_ == Algorithm::in_float;
    if (op == ArithmeticOp::min || op == ArithmeticOp::max) return false;
    if (type_ == (single ? DataType::float32 : DataType::float64)) return false;
    int const digits = single ? 24 : 53;
    // Sums of integers fit, products do or are far outside of the result's type, and a quotient that is no half lies
    // further from one than it is off.
    int const small = single ? 16 : 32;
    if (is_integer(type_) && u.lowest >= 0 && v.lowest >= 0 && u.highest <= small && v.highest <= small) return false;
    if (op == ArithmeticOp::mul) return u.digits + v.digits > digits;
    if (op == ArithmeticOp::div) return v.digits > 1 || u.digits > digits;
    return std::max(u.highest, v.highest) + 1 - std::min(u.lowest, v.lowest) > digits;
}

Plan Arithmetic::plan(std::span<Header const> inputs) {
    Header const& first = inputs.front();
    Header const* const second = inputs.size() > 1 ? &inputs[1] : nullptr;
    number_a_ = as_number(both()[0]);
    number_b_ = as_number(both()[1]);
    counts_ = {};
    if (second != nullptr) {
        if (first.kind != second->kind)
            throw Error(ErrorKind::usage, "one of the volumes is hierarchical",
                        "make it a grid first: vkt resample --cells 50M");
        char const* const hint = "vkt resample SECOND --like FIRST puts the second onto the grid of the first";
        if (!(first.dims == second->dims))
            throw Error(ErrorKind::usage,
                        text("the volumes differ in size: ", first.dims, " and ", second->dims, " voxels"), hint);
        if (!same_geometry(first.geometry, geometry_beside(first, *second)))
            throw Error(ErrorKind::usage,
                        "the volumes lie at different places in the world (origin, spacing or direction)", hint);
    }
    Plan plan;
    plan.output = first;
    choose_values(first, second, plan.output);
    voxels_ = first.voxels();
    plan.method = algorithm_ == Algorithm::in_integers ? "128-bit integers"
                  : algorithm_ == Algorithm::in_float  ? "float32"
                                                       : "float64";
    if (settles_) plan.method += ", exact where that would round twice";
    if (algorithm_ == Algorithm::in_integers) plan.cost = 8;
    if (!(map_a_ == ValueMap{} && map_b_ == ValueMap{})) { // a few roundings, unless values cancel
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = 1e-15;
    }
    return plan;
}

void Arithmetic::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ArithmeticTask task;
    task.op = op;
    std::size_t next = 0;
    auto const take = [&](std::optional<Number> const& number, ArithmeticOperand& operand) {
        if (number) {
            operand.number = number->value;
            operand.whole = number->whole.value_or(0);
            operand.exact_number = exact(*number);
            if (is_inexact(*number)) operand.inexact_from = 0;
        } else {
            operand.view = &inputs[next++];
            if (is_wide(operand.view->type)) operand.inexact_from = 0x1p53;
        }
    };
    take(number_a_, task.a);
    take(number_b_, task.b);
    task.a.map = map_a_;
    task.b.map = map_b_;
    task.result = map_out_;
    task.settles = settles_;
    task.count_zeros = op == ArithmeticOp::div && integers_;
    Losses counts;
    switch (algorithm_) {
    case Algorithm::in_float:
        arithmetic_float(task, out, counts, execution);
        break;
    case Algorithm::in_double:
        arithmetic_double(task, out, counts, execution);
        break;
    case Algorithm::in_integers:
        arithmetic_integers(task, out, counts, execution);
        break;
    }
    counts_ += counts;
}

std::vector<Remark> Arithmetic::remarks() const {
    std::vector<Remark> result = store_remarks(counts_, voxels_, type_);
    if (counts_.undefined > 0) result.push_back({text(share_text(counts_.undefined, voxels_), " divided by zero"), true});
    return result;
}

} // namespace vkt
