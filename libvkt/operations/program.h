// From an expression's operations to the instructions that kernels run, and what values they may yield.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/expression.h"
#include "libvkt/operations/kernels/transform.h"

#include <span>
#include <vector>

namespace vkt {

/// Instructions for an expression without extents (see Expression::with_extent).
Program compile(Expression const& expression);

/// What is known of a node's values: whole numbers or not, and bounds.
struct Values {
    bool whole = false;
    double low = 0, high = 0;
    bool bounded() const;
};

/// The values of every node, given those of the volumes and the positions along x, y, z.
std::vector<Values> values_of(Expression const& expression, std::span<Values const> volumes,
                              std::span<Values const> positions);

} // namespace vkt
