// Arithmetic: in which values and which type it is computed, and what the result is stored as.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/arithmetic.h"

#include "libvkt/core/wide.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/beside.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/common/same_grid.h"
#include "libvkt/operations/voxels/exact.h"
#include "libvkt/operations/voxels/kernels/arithmetic.h"
#include "libvkt/operations/voxels/kernels/arithmetic_settled.h"
#include "libvkt/operations/voxels/kernels/fill.h"

#include <bit>
#include <cmath>

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

int operand_count(ArithmeticOp op) {
    if (op == ArithmeticOp::clamp || op == ArithmeticOp::where) return 3;
    return op >= ArithmeticOp::not_ ? 1 : 2;
}

namespace {

/// Whether stored values of two volumes with this map give, combined, the stored value of what is meant.
bool agrees_with(ValueMap const& map, ArithmeticOp op) {
    switch (op) {
    case ArithmeticOp::add:
    case ArithmeticOp::sub:
        return map.intercept == 0;
    case ArithmeticOp::absdiff:
        return map.intercept == 0 && map.slope > 0;
    case ArithmeticOp::eq:
    case ArithmeticOp::ne:
    case ArithmeticOp::where:
        return true;
    case ArithmeticOp::mul:
    case ArithmeticOp::div:
        return false;
    default:
        return map.slope > 0; // what is larger stays larger
    }
}

/// What powers that are counted as undefined are: what a number, as base or exponent, leaves possible.
char const* undefined_powers(std::optional<Number> const& base, std::optional<Number> const& exponent) {
    bool const divide = (!base || base->value == 0) && (!exponent || exponent->value < 0);
    bool const root = (!base || base->value < 0) && (!exponent || exponent->value != std::floor(exponent->value));
    if (divide && root)
        return " undefined: 0 to a power below 0, divided by zero, or powers of numbers below 0 that no real number is";
    return divide ? " undefined: 0 to a power below 0, divided by zero"
                  : " undefined: powers that no real number is, of numbers below 0";
}

/// Refuses what is spelt as a number and is none, 1e999 or nan, before a file of that name is looked for.
void refuse_no_number(std::string const& word) {
    std::string const bare = lower_case(word.substr(word.starts_with('-') || word.starts_with('+') ? 1 : 0));
    bool const digits = bare.find_first_not_of("0123456789.e+-") == std::string::npos;
    if (bare != "nan" && (!digits || bare.find_first_of("0123456789") == std::string::npos)) return;
    try {
        (void)parse_double(word);
    } catch (Error const& error) {
        throw Error(ErrorKind::usage, error.what(), text("a file of that name is written ./", word));
    }
}
/// Asks only whether values are 0.
bool is_logic(ArithmeticOp op) {
    return op == ArithmeticOp::and_ || op == ArithmeticOp::or_ || op == ArithmeticOp::not_;
}

} // namespace

std::vector<std::string> Arithmetic::operands() const {
    std::vector<std::string> result;
    for (auto const& operand : {a, b, c})
        if (!operand.empty()) result.push_back(operand);
    if (static_cast<int>(result.size()) < operand_count(op)) result.insert(result.begin(), "-");
    return result;
}

std::vector<std::string> Arithmetic::input_names() const {
    std::vector<std::string> result;
    for (auto const& operand : operands())
        if (!as_number(operand)) result.push_back(operand);
    if (result.empty()) result.push_back("-"); // nothing is said yet
    return result;
}

Texts Arithmetic::texts() const {
    return {
        "Calculate with volumes and numbers, voxel by voxel.",
        "Two operands: add, sub, mul, div, min, max, absdiff, pow; gt, ge, lt, le, eq, ne, and, or give 0 and 1. "
        "One: not, abs, neg, sqrt, exp, log. Three: clamp VOLUME LOW HIGH, and where MASK A B, which takes A where "
        "the mask is not 0 and B elsewhere. Results saturate and are rounded half to even. Two volumes of one type "
        "give that type; else the smallest type that holds both; functions give floats. What is clipped or divided "
        "by zero is counted and reported."
        "\n\n"
        "Accuracy: Correctly rounded, whatever the types of operands and result; through slopes and intercepts about "
        "1e-15 of the largest value that occurs on the way (estimate).",
        {{"A volume and a number", "vkt make ramp --dims 16 16 16 | vkt arith mul - 2.5 | vkt stats"},
         {"Two volumes", "vkt make noise --dims 16 16 16 -o a.vkt && vkt make ramp --dims 16 16 16 | vkt arith sub - "
                         "a.vkt | vkt stats"},
         {"Keep what is bright", "vkt arith gt volume.nrrd 0.5 -o bright.nrrd && vkt arith where bright.nrrd "
                                 "volume.nrrd 0 | vkt stats"}}};
}

void Arithmetic::parameters(Parameters& p) {
    p.positional("op", op, "the operation");
    p.positional("a", a, "first operand: a volume ('-' is standard input) or a number").optional();
    p.positional("b", b, "second operand; if one too few is given, the first is standard input").optional();
    p.positional("c", c, "third operand").optional();
    p.option("dtype", dtype, "TYPE", "data type of the result");
    p.option(
        "roi", roi, "REGION",
        "compute only the voxels of this region; the others keep the first volume's values, and its type, or are 0 "
        "in a mask");
}

std::vector<Knob> Arithmetic::knobs() const { return {type_knob()}; }

void Arithmetic::check() const {
    auto const given = static_cast<int>(!a.empty()) + static_cast<int>(!b.empty()) + static_cast<int>(!c.empty());
    int const wanted = operand_count(op);
    if (given > wanted || given + 1 < wanted)
        throw Error(ErrorKind::usage, text(enum_name(op), " takes ", wanted, wanted == 1 ? " operand" : " operands",
                                           ", of which the first may be standard input; ", given, " are given"));
    auto const words = operands();
    for (auto const& word : words) refuse_no_number(word);
    bool const volumes = std::any_of(words.begin(), words.end(), [](auto const& w) { return !as_number(w); });
    if (!volumes)
        throw Error(ErrorKind::usage,
                    wanted == 1 ? text("the operand, ", a, ", is a number")
                                : text(wanted == 2 ? "both operands, " : "all operands, ", join(words, " and "),
                                       ", are numbers"),
                    text("a file of that name is written ./", a));
    if (op != ArithmeticOp::clamp) return;
    auto const low = as_number(words[1]), high = as_number(words[2]);
    if (as_number(words[0]) || !low || !high) throw Error(ErrorKind::usage, "clamp takes a volume and two numbers");
    if (!(low->value <= high->value))
        throw Error(ErrorKind::usage, text("clamp: ", low->value, " is not below ", high->value));
}

/// The type of the result, and its value map where values are combined as they are stored.
void Arithmetic::choose_type(std::vector<Header const*> const& headers, Choice& choice) const {
    std::vector<Header const*> volumes; // that the result's values come from
    for (std::size_t i = op == ArithmeticOp::where ? 1 : 0; i < headers.size(); ++i)
        if (headers[i] != nullptr) volumes.push_back(headers[i]);
    if (volumes.empty()) { // where between two numbers
        choice.type = DataType::float64;
        choice.values = {};
    } else {
        choice.type = volumes.front()->dtype;
        choice.values = volumes.front()->values;
        if (volumes.size() > 1) choice.type = promoted(volumes[0]->dtype, volumes[1]->dtype);
    }
    bool const small = std::all_of(volumes.begin(), volumes.end(), [](Header const* h) {
        return size_of(h->dtype) <= 2 || h->dtype == DataType::float32;
    });
    if (keeps_first()) { // all else stays what it is
        choice.type = volumes.front()->dtype;
        choice.values = volumes.front()->values;
    } else if (is_predicate(op)) {
        choice.type = DataType::uint8;
        choice.values = {};
    } else if (is_function(op)) {
        choice.type = small ? DataType::float32 : DataType::float64;
        choice.values = {};
    } else if (volumes.size() > 1 && !(volumes[0]->values == volumes[1]->values)) {
        choice.values = {};
        choice.type = small ? DataType::float32 : DataType::float64;
    }
    if (dtype) choice.type = *dtype;
}

/// Whether where takes integers that float64 does not hold, as they are stored, by a mask that 128-bit integers do not
/// hold: by what it means, or of floats.
bool Arithmetic::is_exact_choice(std::vector<Header const*> const& headers, Choice const& choice) const {
    Header const& mask = *headers[0];
    bool wide = is_wide(choice.type), whole = is_integer(choice.type) && choice.map_out == ValueMap{};
    for (std::size_t i = 1; i < headers.size(); ++i) {
        wide = wide || (headers[i] != nullptr && is_wide(headers[i]->dtype));
        whole = whole && choice.maps[i] == ValueMap{} &&
                (headers[i] != nullptr ? is_integer(headers[i]->dtype) : choice.numbers[i] && choice.numbers[i]->whole);
    }
    return wide && whole && (!is_integer(mask.dtype) || !(mask.values == ValueMap{}));
}

/// Decides in which values to compute.
void Arithmetic::choose_values(std::vector<Header const*> const& headers, Choice& choice) const {
    std::size_t const n = headers.size();
    bool const number = std::any_of(headers.begin(), headers.end(), [](Header const* h) { return h == nullptr; });
    bool differ = false;
    Header const* first = nullptr;
    for (std::size_t i = op == ArithmeticOp::where ? 1 : 0; i < n; ++i) {
        if (headers[i] == nullptr) continue;
        differ = differ || (first != nullptr && !(first->values == headers[i]->values));
        if (first == nullptr) first = headers[i];
    }
    bool const mapped = first != nullptr && !(first->values == ValueMap{});
    // Signs, zeros and functions are of physical values; clamp and where keep stored ones, and numbers follow them.
    bool const meant = number || is_function(op) || is_logic(op) || n == 1;
    bool const physical = differ || (mapped && (meant || !agrees_with(first->values, op)));
    bool const picks = op == ArithmeticOp::clamp || (op == ArithmeticOp::where && !differ);
    if (picks && mapped) {
        for (std::size_t i = 1; i < n; ++i)
            if (choice.numbers[i]) choice.numbers[i] = Number(first->values.stored(choice.numbers[i]->value));
        if (op == ArithmeticOp::clamp && first->values.slope < 0) std::swap(choice.numbers[1], choice.numbers[2]);
    } else if (physical && !picks) {
        for (std::size_t i = 0; i < n; ++i)
            if (headers[i] != nullptr) choice.maps[i] = headers[i]->values;
        choice.map_out = choice.values;
    }
    if (op == ArithmeticOp::where && headers[0] != nullptr) { // 0 is what is meant
        if (is_exact_choice(headers, choice))
            choice.mask = headers[0]->values;
        else
            choice.maps[0] = headers[0]->values;
    }
    if (op == ArithmeticOp::where && choice.numbers[0])
        choice.numbers[0] = Number(choice.numbers[0]->value != 0 ? 1 : 0);
    bool const stored = choice.maps == std::array<ValueMap, 3>{} && choice.map_out == ValueMap{};
    auto const fits_float = [](std::optional<Number> const& v) {
        return !v || static_cast<double>(static_cast<float>(v->value)) == v->value;
    };
    auto const small_type = [](DataType t) { return size_of(t) <= 2 || t == DataType::float32; };
    bool whole = !is_function(op), integers = true, wide = is_wide(choice.type), small = small_type(choice.type);
    for (std::size_t i = 0; i < n; ++i) {
        whole = whole && (!choice.numbers[i] || choice.numbers[i]->whole);
        if (headers[i] == nullptr) {
            small = small && fits_float(choice.numbers[i]);
            continue;
        }
        integers = integers && is_integer(headers[i]->dtype);
        wide = wide || is_wide(headers[i]->dtype);
        small = small && small_type(headers[i]->dtype);
    }
    integers = integers || choice.mask;
    choice.integers = integers && is_integer(choice.type);
    // A root in float64, rounded to float32, is that in float32: 53 >= 2 * 24 + 2 digits.
    if (stored && choice.integers && wide && whole)
        choice.algorithm = Algorithm::in_integers;
    else if (stored && small && (!is_function(op) || (op == ArithmeticOp::sqrt && choice.type == DataType::float32)))
        choice.algorithm = Algorithm::in_float;
    if (n != 2 || !stored || choice.algorithm == Algorithm::in_integers || is_function(op) || is_logic(op)) return;
    auto const of = [&](std::size_t i) {
        return choice.numbers[i] ? Operand::of(*choice.numbers[i]) : Operand::of(headers[i]->dtype);
    };
    choice.settles = rounds_twice(choice, of(0), of(1));
}

/// True if rounding to the type of the computation first, and then to that of the result, may go wrong.
bool Arithmetic::rounds_twice(Choice const& choice, Operand const& u, Operand const& v) const {
    if (u.inexact || v.inexact) return true;
    bool const single = choice.algorithm == Algorithm::in_float;
    if (op == ArithmeticOp::min || op == ArithmeticOp::max || is_predicate(op)) return false;
    if (choice.type == (single ? DataType::float32 : DataType::float64)) return false;
    int const digits = single ? 24 : 53;
    // Sums of integers fit, products do or are far outside of the result's type, and a quotient that is no half lies
    // further from one than it is off.
    int const small = single ? 16 : 32;
    if (is_integer(choice.type) && u.lowest >= 0 && v.lowest >= 0 && u.highest <= small && v.highest <= small)
        return false;
    if (op == ArithmeticOp::mul) return u.digits + v.digits > digits;
    if (op == ArithmeticOp::div) return v.digits > 1 || u.digits > digits;
    return std::max(u.highest, v.highest) + 1 - std::min(u.lowest, v.lowest) > digits;
}

Arithmetic::Choice Arithmetic::choice(std::span<Header const> inputs) const {
    Choice choice;
    std::vector<Header const*> headers;
    std::size_t next = 0;
    for (auto const& word : operands()) {
        choice.numbers.push_back(as_number(word));
        headers.push_back(choice.numbers.back() || next >= inputs.size() ? nullptr : &inputs[next++]);
    }
    choose_type(headers, choice);
    choose_values(headers, choice);
    return choice;
}

Plan Arithmetic::plan(std::span<Header const> inputs) const {
    require_same_grid(inputs);
    static_cast<void>(LevelRegion(roi, inputs.front())); // or it is refused
    Choice const choice = this->choice(inputs);
    Plan plan;
    plan.output = inputs.front();
    plan.output.dtype = choice.type;
    plan.output.values = choice.values;
    plan.method = choice.algorithm == Algorithm::in_integers ? "128-bit integers"
                  : choice.algorithm == Algorithm::in_float  ? "float32"
                                                             : "float64";
    if (choice.settles) plan.method += ", exact where that would round twice";
    if (choice.algorithm == Algorithm::in_integers) plan.cost = 8;
    if (op == ArithmeticOp::div && is_integer(choice.type)) plan.cost = 60; // divisors of 0 are looked for
    if (is_function(op)) {
        plan.cost = op == ArithmeticOp::sqrt ? 60 : op == ArithmeticOp::pow ? 450 : 180;
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = 4 * 0x1p-53 + storing_error(choice.type);
    } else if (!(choice.maps == std::array<ValueMap, 3>{}) && !is_predicate(op)) { // a few roundings, if none cancel
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = 1e-15;
    } else if ((op == ArithmeticOp::clamp || op == ArithmeticOp::where) && !(choice.values == ValueMap{}) &&
               (choice.numbers[1] || choice.numbers[2])) { // numbers as they are stored, to the last bits of double
        plan.error.kind = ErrorBound::Kind::bound;
        plan.error.magnitude = 4 * 0x1p-53;
        plan.error.absolute = 4 * 0x1p-53 * std::abs(choice.values.intercept);
    }
    pass(inputs, choice, plan);
    return plan;
}

void Arithmetic::begin(std::span<Header const> inputs, Plan const&) {
    choice_ = choice(inputs);
    voxels_ = inputs.front().voxels();
    counts_ = {};
    inside_ = {roi, inputs.front()};
}

void Arithmetic::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = inside_.part_of(out.box);
    if (inside == out.box) return compute(inputs, out, execution);
    auto const parts = [&](Box const& box) {
        std::vector<ConstView> result;
        for (ConstView const& input : inputs) result.push_back(input.part(box));
        return result;
    };
    for_each_beside(out.box, inside, [&](Box const& box) { keep(parts(box), out.part(box), execution); });
    if (!inside.empty()) compute(parts(inside), out.part(inside), execution);
}

void Arithmetic::keep(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    if (is_predicate(op)) return fill_box(out, VoxelBytes{}, execution);
    if (op == ArithmeticOp::where) {
        ArithmeticTask nowhere = task();
        nowhere.volume[0] = -1;
        nowhere.number[0] = 0;
        nowhere.whole[0] = 0;
        nowhere.map[0] = {};
        std::vector<ConstView> operands(inputs.begin(), inputs.end());
        operands[0] = operands.back(); // whatever it is: the mask may be of floats where all else is of integers
        return arithmetic(nowhere, operands, out, counts_, execution);
    }
    if (inputs[0].type == out.type)
        copy_region(inputs[0], out, execution);
    else
        convert_values(inputs[0], out, counts_, execution);
}

void Arithmetic::compute(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    if (choice_.settles) {
        std::array<ExactOperand, 2> operand;
        std::size_t next = 0;
        for (std::size_t i = 0; i < 2; ++i) {
            if (choice_.numbers[i]) {
                operand[i].number = choice_.numbers[i]->value;
                operand[i].exact_number = exact(*choice_.numbers[i]);
                if (is_inexact(*choice_.numbers[i])) operand[i].inexact_from = 0;
            } else {
                operand[i].view = &inputs[next++];
                if (is_wide(operand[i].view->type)) operand[i].inexact_from = 0x1p53;
            }
        }
        return arithmetic_settled(op, choice_.algorithm == Algorithm::in_float, operand[0], operand[1], out, counts_,
                                  execution);
    }
    if (!choice_.mask) return arithmetic(task(), inputs, out, counts_, execution);
    // 1 where the mask is not 0, in the place of the result.
    ArithmeticTask is_set;
    is_set.op = ArithmeticOp::ne;
    is_set.map[0] = *choice_.mask;
    arithmetic(is_set, inputs.first(1), out, counts_, execution);
    std::vector<ConstView> operands(inputs.begin(), inputs.end());
    operands[0] = out;
    arithmetic(task(), operands, out, counts_, execution);
}

ArithmeticTask Arithmetic::task() const {
    ArithmeticTask task;
    task.op = op;
    task.type = choice_.algorithm == Algorithm::in_integers ? ArithmeticType::in_integers
                : choice_.algorithm == Algorithm::in_float  ? ArithmeticType::in_float
                                                            : ArithmeticType::in_double;
    int next = 0;
    for (std::size_t i = 0; i < choice_.numbers.size(); ++i) {
        task.volume[i] = choice_.numbers[i] ? -1 : next++;
        if (!choice_.numbers[i]) continue;
        task.number[i] = choice_.numbers[i]->value;
        task.whole[i] = choice_.numbers[i]->whole.value_or(0);
    }
    task.map = choice_.maps;
    task.result = choice_.map_out;
    task.counts_zeros = op == ArithmeticOp::div && choice_.integers;
    task.lowest = lowest_of(choice_.type);
    task.highest = highest_of(choice_.type);
    return task;
}

std::vector<Remark> Arithmetic::remarks() const {
    std::vector<Remark> result = store_remarks(counts_, voxels_, choice_.type);
    char const* const what = op == ArithmeticOp::sqrt  ? " undefined: roots of numbers below 0"
                             : op == ArithmeticOp::log ? " undefined: logarithms of numbers not above 0"
                             : op == ArithmeticOp::pow ? undefined_powers(choice_.numbers.at(0), choice_.numbers.at(1))
                                                       : " divided by zero";
    if (counts_.undefined > 0) result.push_back({text(share_text(counts_.undefined, voxels_), what), true});
    return result;
}

} // namespace vkt
