// Bounds in values, and what storing costs.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/error_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt {

void ErrorBound::limit(DataType type, double slope, std::optional<double> stored_border) {
    if (exact() || !is_integer(type)) return;
    double lowest = lowest_of(type), highest = highest_of(type);
    if (stored_border) {
        if (!std::isfinite(*stored_border)) return;
        lowest = std::min(lowest, *stored_border);
        highest = std::max(highest, *stored_border);
    }
    double const stored = range * (highest - lowest) + magnitude * std::max(-lowest, highest);
    in_values = stored * std::abs(slope) + absolute;
}

ErrorPassing ErrorPassing::jumps(std::optional<ValueInterval> values) {
    ErrorPassing passing = computed(std::numeric_limits<double>::infinity(), values);
    passing.storing = Storing::whole;
    return passing;
}

double storing_error(DataType type) {
    if (type == DataType::float16) return 0x1p-11;
    if (type == DataType::float32) return 0x1p-24;
    return type == DataType::float64 ? 0x1p-53 : 0;
}

double storing_floor(DataType type) {
    if (type == DataType::float16) return 0x1p-25;
    if (type == DataType::float32) return 0x1p-150;
    return type == DataType::float64 ? 0x1p-1074 : 0;
}

} // namespace vkt
