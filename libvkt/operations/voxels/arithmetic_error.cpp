// Arithmetic: between which values results lie, and what becomes of the errors of the inputs.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/travelled.h"
#include "libvkt/operations/voxels/arithmetic.h"

#include <cmath>
#include <optional>

namespace vkt {

namespace {

/// Why a function may pass on errors without a limit.
char const* steepness(ArithmeticOp op) {
    switch (op) {
    case ArithmeticOp::exp:
        return "values of its type may be too large for exp";
    case ArithmeticOp::log:
        return "values may be 0 or less, or come near it";
    case ArithmeticOp::pow:
        return "a power is limited for a number as exponent, and for values it is finite for";
    default:
        return "";
    }
}

struct FunctionRange {
    ValueInterval values;
    double steepest; ///< magnitude of the slope
};

/// x^p for x within an interval, known to an error; none where it may be no number, or steeper than any.
std::optional<FunctionRange> power_range(ValueInterval const& x, double error, double p) {
    double const low = x.low - error, high = x.high + error;
    bool const whole = p == std::floor(p), crosses = low <= 0 && high >= 0;
    if ((low < 0 && !whole) || (crosses && p < 1 && p != 0)) return {};
    ValueInterval values{std::min(std::pow(x.low, p), std::pow(x.high, p)),
                         std::max(std::pow(x.low, p), std::pow(x.high, p))};
    if (crosses) values = values.with(p == 0 ? 1 : 0);
    double const steepest = std::max(std::pow(std::abs(low), p - 1), std::pow(std::abs(high), p - 1));
    return FunctionRange{values, p == 0 ? 0 : std::abs(p) * steepest};
}

} // namespace

/// Of values as they are stored where they are combined so; a common value map then changes no sum's error.
void Arithmetic::pass(std::span<Header const> inputs, Choice const& choice, Plan& plan) const {
    struct Term {
        std::optional<ValueInterval> values;
        double error = 0;
        bool volume = false;
    };
    std::vector<Term> terms;
    bool mapped = !(plan.output.values == ValueMap{}), whole = true, numbers = false;
    std::size_t next = 0;
    for (auto const& number : choice.numbers) {
        if (number) {
            terms.push_back({ValueInterval{number->value, number->value}});
            if (!std::isfinite(number->value)) terms.back().values.reset();
            whole = whole && number->whole;
            numbers = true;
            continue;
        }
        Header const& in = inputs[next++];
        terms.push_back({values_of(in), in.error.at_most, true});
        if (choice.mask && next == 1) continue; // looked at by itself
        mapped = mapped || !(in.values == ValueMap{});
        whole = whole && is_integer(in.dtype);
    }
    while (terms.size() < 3) terms.emplace_back();
    Term const &u = terms[0], &v = terms[1], &w = terms[2];
    std::vector<double> gains{1, 1, 1};
    std::optional<ValueInterval> values;
    std::optional<double> passed;
    bool const two = u.values && v.values;
    auto const all = [&](auto const& of) { // the extremes of a function that has them at the ends
        ValueInterval r{HUGE_VAL, -HUGE_VAL};
        for (double const x : {u.values->low, u.values->high})
            for (double const y : {v.values->low, v.values->high}) r = r.with(of(x, y));
        values = r;
    };
    plan.passing = ErrorPassing::computed(1, {});
    switch (op) {
    case ArithmeticOp::add:
        if (two) all([](double x, double y) { return x + y; });
        break;
    case ArithmeticOp::sub:
        if (two) all([](double x, double y) { return x - y; });
        break;
    case ArithmeticOp::absdiff:
        if (two) values = ValueInterval{0, std::max(u.values->high - v.values->low, v.values->high - u.values->low)};
        break;
    case ArithmeticOp::min:
    case ArithmeticOp::max:
        if (two) values = u.values->with(*v.values);
        passed = std::max(u.error, v.error);
        break;
    case ArithmeticOp::mul:
        if (two) all([](double x, double y) { return x * y; });
        gains[0] = v.values ? v.values->reach() + v.error : HUGE_VAL;
        gains[1] = u.values ? u.values->reach() : HUGE_VAL;
        break;
    case ArithmeticOp::div: {
        double least = 0; // of the divisor's magnitude
        if (v.values && v.values->low > 0) least = v.values->low;
        if (v.values && v.values->high < 0) least = -v.values->high;
        if (two && least > 0) all([](double x, double y) { return x / y; });
        double const exact = least - v.error;
        gains[0] = exact > 0 ? 1 / exact : HUGE_VAL;
        gains[1] = exact > 0 && u.values ? u.values->reach() / (least * exact) : HUGE_VAL;
        if (!(exact > 0)) plan.passing.because = "the divisor may be 0";
        whole = false;
        break;
    }
    case ArithmeticOp::neg:
        if (u.values) values = ValueInterval{-u.values->high, -u.values->low};
        break;
    case ArithmeticOp::abs:
        if (u.values) values = ValueInterval{0, u.values->reach()};
        break;
    case ArithmeticOp::clamp:
        if (v.values && w.values) {
            ValueInterval const kept{v.values->low, w.values->high};
            values = u.values ? u.values->within(kept) : kept;
        }
        break;
    case ArithmeticOp::where:
        if (v.values && w.values) values = v.values->with(*w.values);
        gains[0] = u.volume ? HUGE_VAL : 1;
        if (u.error == 0) passed = std::max(v.error, w.error);
        break;
    case ArithmeticOp::sqrt:
        if (u.values) {
            double const low = u.values->low - u.error;
            values = ValueInterval{0, std::sqrt(std::max(0.0, u.values->high))};
            passed = low > 0 ? std::min(std::sqrt(u.error), u.error / (2 * std::sqrt(low))) : std::sqrt(u.error);
        } else {
            passed = std::sqrt(u.error);
        }
        break;
    case ArithmeticOp::exp:
        if (u.values) values = ValueInterval{std::exp(u.values->low), std::exp(u.values->high)};
        gains[0] = u.values ? std::exp(u.values->high + u.error) : HUGE_VAL;
        break;
    case ArithmeticOp::log:
        if (u.values && u.values->low > 0) values = ValueInterval{std::log(u.values->low), std::log(u.values->high)};
        gains[0] = u.values && u.values->low > u.error ? 1 / (u.values->low - u.error) : HUGE_VAL;
        break;
    case ArithmeticOp::pow:
        gains.assign(3, HUGE_VAL);
        if (u.values && v.values && !v.volume)
            if (auto const power = power_range(*u.values, u.error, v.values->low)) {
                values = power->values;
                gains[0] = power->steepest;
            }
        break;
    default: // comparisons, logic
        gains.assign(3, HUGE_VAL);
        if (is_predicate(op)) values = ValueInterval{0, 1};
        break;
    }
    bool const unlimited = (u.volume && !u.values) || (v.volume && !v.values);
    if (!is_predicate(op) && plan.passing.because.empty())
        plan.passing.because = unlimited ? "nothing limits the values of a float volume" : steepness(op);
    bool const sums = op == ArithmeticOp::add || op == ArithmeticOp::sub || op == ArithmeticOp::absdiff ||
                      op == ArithmeticOp::neg || op == ArithmeticOp::abs;
    bool const picks =
        op == ArithmeticOp::min || op == ArithmeticOp::max || op == ArithmeticOp::clamp || op == ArithmeticOp::where;
    if (mapped) { // products and constants of stored values mean others
        if (!is_predicate(op)) plan.passing.because = "values under a value map";
        values.reset();
        passed.reset();
        if (!sums && !picks) gains.assign(3, HUGE_VAL);
        if (picks && numbers) gains.assign(3, HUGE_VAL);
    }
    if (mapped && !is_integer(choice.type)) {
        plan.passing = {};
        plan.passing.because = "values under a value map";
        return;
    }
    plan.passing.gain.clear();
    for (std::size_t i = 0; i < choice.numbers.size(); ++i)
        if (!choice.numbers[i]) plan.passing.gain.push_back(gains[i]);
    if (keeps_first()) {
        auto const kept = values_of(inputs.front());
        values = values && kept ? std::optional(values->with(*kept)) : std::nullopt;
        plan.passing.gain.front() = std::max(plan.passing.gain.front(), 1.0);
        if (passed) passed = std::max(*passed, inputs.front().error.at_most);
    }
    plan.passing.passed = passed;
    plan.passing.values = values;
    if (is_predicate(op) || (whole && !mapped && !is_function(op) && is_integer(choice.type)))
        plan.passing.storing = ErrorPassing::Storing::whole;
    if (!is_function(op)) return;
    // Some units in the last place of the result, not of what goes in.
    double const largest = values && values->finite() ? values->reach() : HUGE_VAL;
    plan.passing.own = (4 * 0x1p-53 + storing_error(choice.type)) * largest + storing_floor(choice.type) +
                       (is_integer(choice.type) ? 0.5 * std::abs(plan.output.values.slope) : 0);
}

} // namespace vkt
