// How far a result may be from what exact arithmetic gives for the same input, as far as that is known before any value
// is. SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <optional>

namespace vkt {

/// For every voxel |result - exact|, as physical values, is at most
///     range * (largest value - smallest value) + magnitude * |slope| * largest |stored value| + absolute.
/// A constant border counts as one of the values. The share of the magnitude is what rounding costs, and far more than
/// the same share of the range for data with an offset. What is exact or correctly rounded has no error; for integer
/// outputs the rounding to whole numbers comes on top of a bound, for floats it is part of it. Of an unknown error
/// nothing is told.
struct ErrorBound {
    enum class Kind : std::uint8_t { exact, bound, estimate, unknown };

    Kind kind = Kind::exact;
    double range = 0;
    double magnitude = 0;
    double absolute = 0;             ///< physical value
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

/// Largest relative error of storing a number in a float type that is normal there; 0 for integers.
double storing_error(DataType type);
/// Largest error of storing a number below the smallest normal one of a float type; 0 for integers.
double storing_floor(DataType type);

} // namespace vkt
