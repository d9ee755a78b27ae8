// Comparing two slabs row by row.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

/// What one row contributes.
struct RowDifference {
    std::int64_t differing = 0, first = 0; ///< first: x, if any differ
    long double squares = 0;               ///< has room for squares of all doubles
    double max_abs = 0;
    double low = 0, high = 0; ///< finite extremes of the first volume; low > high if there are none
};

/// Two slabs of equal box and the maps to the values that are compared.
struct SlabPair {
    ConstView a, b;
    ValueMap map_a, map_b;
};

VKT_KERNEL(difference_rows, (SlabPair const& pair, RowDifference* rows, Execution const& execution),
           (pair, rows, execution))

} // namespace vkt
