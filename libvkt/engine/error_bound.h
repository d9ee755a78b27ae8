// How far a result may be from what exact arithmetic gives for the same input, as far as that is known before any value
// is.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/core/volume_error.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// For every voxel |result - exact|, as physical values, is at most
///     range * (largest value - smallest value) + magnitude * |slope| * largest |stored value| + absolute.
/// A constant border counts as one of the values. The share of the magnitude is what rounding costs, and far more than
/// the same share of the range for data with an offset. What is exact or correctly rounded has no error; for integer
/// outputs the rounding to whole numbers comes on top of a bound, for floats it is part of it. Of an unknown error
/// nothing is told.
struct ErrorBound {
    using Kind = Certainty;

    Kind kind = Kind::exact;
    double range = 0;
    double magnitude = 0;
    double absolute = 0; ///< physical value, or what `quantity` says
    /// What `absolute` is one of, where operations promise something else of their results than values.
    char const* quantity = "values";
    std::optional<double> in_values; ///< all of it as a physical value, where the input's type limits the values

    static ErrorBound none_known() {
        ErrorBound error;
        error.kind = Kind::unknown;
        return error;
    }
    bool exact() const { return kind == Kind::exact; }
    /// The bound for stored values of that range and largest magnitude under a slope of 1.
    double over(double value_range, double largest) const {
        return range * value_range + magnitude * largest + absolute;
    }
    /// Fills in in_values for stored values of that type under that slope, and perhaps a border value among them; only
    /// integer types limit values to what is worth telling.
    void limit(DataType type, double slope, std::optional<double> stored_border);
};

/// How the errors of its inputs come out of an operation, and what else is to be known about its result before any
/// voxel is. The default is that nothing is known, and that is what the result then says, unless the plan hands the
/// input through under the same value map. See travelled().
struct ErrorPassing {
    /// How results become voxels.
    enum class Storing : std::uint8_t {
        moves,    ///< each is a voxel of an input, or a constant that its type holds: nothing is rounded
        converts, ///< each is a value of an input, rounded where the type of the result does not hold it
        whole,    ///< whole numbers: rounded only in floats
        computes, ///< rounded to the type of the result
    };

    bool known = false;
    std::string because; ///< not known: why, for people
    /// By how much the physical values of the result change at most if those of each input change by 1. Infinite where
    /// the result is not continuous: only inputs that are exact leave an error that is known.
    std::vector<double> gain;
    std::optional<double> passed; ///< what the inputs' errors become, where it is known better than by gains
    Storing storing = Storing::computes;
    std::optional<ValueInterval> values; ///< between which the exact results lie for these inputs
    /// What is beyond the values that the result's integers stand for is clipped, and its rounding without effect.
    bool clips = false;
    double more = 0;           ///< of the operation's own error, beside that of the plan
    std::optional<double> own; ///< instead of the plan's error and of rounding

    /// Every input's error as it is, of voxels that are only moved.
    static ErrorPassing moved(std::optional<ValueInterval> values) {
        ErrorPassing passing;
        passing.known = true;
        passing.gain = {1};
        passing.storing = Storing::moves;
        passing.values = values;
        return passing;
    }
    /// Values that grow by that factor at most.
    static ErrorPassing computed(double gain, std::optional<ValueInterval> values) {
        ErrorPassing passing = moved(values);
        passing.gain = {gain};
        passing.storing = Storing::computes;
        return passing;
    }
    /// Weighted sums of values whose weights sum to 1 and their magnitudes to `gain`.
    static ErrorPassing averaged(double gain, std::optional<ValueInterval> values) {
        if (values) values = values->grown(0.5 * (gain - 1) * values->width());
        return computed(gain, values);
    }
    /// Weighted sums of values whose magnitudes sum to `gain`.
    static ErrorPassing summed(double gain, std::optional<ValueInterval> values) {
        if (values) values = ValueInterval{-gain * values->reach(), gain * values->reach()};
        return computed(gain, values);
    }
    /// Results that jump: only those of exact inputs are known, and are whole numbers.
    static ErrorPassing jumps(std::optional<ValueInterval> values = {});
};

/// Largest relative error of storing a number in a float type that is normal there; 0 for integers.
double storing_error(DataType type);
/// Largest error of storing a number below the smallest normal one of a float type; 0 for integers.
double storing_floor(DataType type);

} // namespace vkt
