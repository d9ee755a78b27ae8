// Travelling errors: gains, own bounds, storing.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/travelled.h"

#include "libvkt/core/label_marks.h"
#include "libvkt/core/text.h"

#include <cmath>

namespace vkt {
namespace {

using Storing = ErrorPassing::Storing;

/// True if every number of one type is one of the other.
bool holds(DataType wide, DataType narrow) {
    if (wide == narrow) return true;
    auto const digits = [](DataType t) {
        if (is_integer(t)) return static_cast<int>(8 * size_of(t)) - (is_signed(t) ? 1 : 0);
        return t == DataType::float16 ? 11 : t == DataType::float32 ? 24 : 53;
    };
    if (is_integer(wide))
        return is_integer(narrow) && lowest_of(wide) <= lowest_of(narrow) && highest_of(wide) >= highest_of(narrow);
    return digits(wide) >= digits(narrow) && highest_of(wide) >= highest_of(narrow) &&
           (is_integer(narrow) || size_of(wide) >= size_of(narrow));
}

/// Half a step of integers, half a unit in the last place of floats.
double rounding_of(Header const& output, std::optional<ValueInterval> const& values) {
    double const slope = std::abs(output.values.slope);
    if (is_integer(output.dtype)) return 0.5 * slope;
    if (!values) return HUGE_VAL;
    return storing_error(output.dtype) * values->reach(output.values.intercept) + slope * storing_floor(output.dtype);
}

bool rounds(Storing storing, std::span<Header const> inputs, Header const& output) {
    if (storing == Storing::moves) return false;
    if (storing == Storing::whole) return !is_integer(output.dtype);
    if (storing == Storing::computes) return true;
    for (Header const& input : inputs) {
        // Integers that are clipped to others are still whole numbers.
        bool const kept = is_integer(output.dtype) ? is_integer(input.dtype) : holds(output.dtype, input.dtype);
        if (!kept || !(input.values == output.values)) return true;
    }
    return false;
}

} // namespace

std::optional<ValueInterval> values_read(Header const& input, Plan const& plan) {
    auto values = values_of(input);
    if (values && plan.boundary == Boundary::border) values = values->with(input.values.physical(plan.border_value));
    if (values && input.kind == Kind::hierarchical) { // what stands where there is no cell
        auto const background = input.attributes.find("background");
        bool const named = background != input.attributes.end() && is_number(background->second);
        values = values->with(named ? parse_double(background->second) : 0);
    }
    return values;
}

VolumeError travelled(std::span<Header const> inputs, Plan const& plan, std::string_view name) {
    Header const& output = plan.output;
    ErrorPassing passing = plan.passing;
    bool const through = plan.shift && inputs.size() == 1 && inputs[0].dtype == output.dtype;
    if (!passing.known && through && inputs[0].values == output.values)
        passing = ErrorPassing::moved(values_of(inputs[0]));
    if (!passing.known)
        return VolumeError::lost(
            text("how ", name, " passes errors on is not known", passing.because.empty() ? "" : ": ", passing.because));
    VolumeError result = VolumeError::given();
    double passed = 0;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        VolumeError const& error = inputs[i].error;
        if (!error.known())
            return VolumeError::lost(error.because.empty() ? "the stream that came into it said nothing"
                                                           : error.because);
        result.kind = std::max(result.kind, error.kind);
        if (error.at_most == 0) continue; // jumps or not
        double const gain = passing.gain.size() == 1 ? passing.gain.front() : passing.gain.at(i);
        if (passing.passed) continue;
        if (!std::isfinite(gain))
            return VolumeError::lost(text(name, passing.because.empty() ? " jumps where values change a little" : ": ",
                                          passing.because, ", and they are known to ", to_sentence(error, "")));
        passed += gain * error.at_most;
    }
    if (passing.passed && result.kind != Certainty::exact) passed = *passing.passed;

    auto const limit = values_of(output.dtype, output.values);
    auto values = passing.values;
    if (values && !values->finite()) values.reset();
    if (values && limit) values = values->within(*limit);
    if (!values && limit) values = limit;

    double own = 0;
    bool const computes = passing.storing != Storing::moves;
    if (passing.own) {
        own = *passing.own;
        result.kind = std::max(result.kind, plan.error.kind);
    } else if (computes) {
        ErrorBound const& error = plan.error;
        if (error.kind == Certainty::unknown) return VolumeError::lost(text(name, " knows no bound of its own error"));
        result.kind = std::max(result.kind, error.kind);
        if (error.range > 0 || error.magnitude > 0) {
            std::optional<ValueInterval> read;
            for (std::size_t i = 0; i < inputs.size(); ++i) {
                auto one = values_read(inputs[i], plan);
                if (passing.clips && limit) one = one ? one->within(*limit) : limit;
                read = i == 0 || !one || !read ? one : read->with(*one);
            }
            if (!read)
                return VolumeError::lost(text(
                    "the error of ", name, " is a share of its values, and those of a float volume are not limited"));
            double largest = 0;
            for (Header const& input : inputs) largest = std::max(largest, read->reach(input.values.intercept));
            own = error.range * read->width() + error.magnitude * largest;
        }
        own += error.absolute;
        // The bound of what is computed in floats holds their rounding.
        if ((error.exact() || is_integer(output.dtype)) && rounds(passing.storing, inputs, output))
            own += rounding_of(output, values);
    }
    own += passing.more;
    if (values && (own > 0 || passed > 0)) {
        values = values->grown(own);
        if (limit) values = values->within(*limit);
    }
    result.at_most = (passed + own) * (1 + 0x1p-40);
    if (values && !limit &&
        values->reach(output.values.intercept) > std::abs(output.values.slope) * highest_of(output.dtype))
        return VolumeError::lost(text("values after ", name, " may be beyond ", output.dtype));
    if (!std::isfinite(result.at_most)) {
        bool const limited = values.has_value();
        return VolumeError::lost(limited
                                     ? text("no finite number limits the error of ", name)
                                     : text("the error of ", name,
                                            " is a share of its values, and those of a float volume are not limited"));
    }
    if (result.at_most == 0) {
        if (result.kind == Certainty::bound) result.kind = Certainty::exact;
    } else if (result.kind == Certainty::exact) {
        result.kind = Certainty::bound;
    }
    if (values && !(limit && *values == *limit) && values->finite()) result.values = values;
    return result;
}

void settle_header(std::span<Header const> inputs, Plan& plan, std::string_view name) {
    plan.output.error = travelled(inputs, plan, name);
    ErrorPassing const& passing = plan.passing;
    // What has a bound of its own for storing values chose a type for them.
    bool const calculated = passing.known && passing.storing == Storing::computes && !passing.own;
    if (calculated && !inputs.empty() && inputs[0].kind == plan.output.kind) forget_labels(plan.output);
}

} // namespace vkt
