// Percentiles by sorting all values.
// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace vkt {

/// Between the two nearest, linearly.
template <class T> double sorted_percentile(std::vector<T> values, double percent) {
    std::sort(values.begin(), values.end());
    double const position = percent / 100 * static_cast<double>(values.size() - 1);
    auto const i = static_cast<std::size_t>(position);
    if (i + 1 == values.size()) return static_cast<double>(values[i]);
    auto const a = static_cast<double>(values[i]), b = static_cast<double>(values[i + 1]);
    return a + (position - static_cast<double>(i)) * (b - a);
}

} // namespace vkt
