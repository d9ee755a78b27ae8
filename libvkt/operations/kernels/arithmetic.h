// Arithmetic of two operands, voxel by voxel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/wide.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/arithmetic.h"
#include "libvkt/operations/exact.h"

#include <limits>

namespace vkt {

/// One operand: a volume (null for a number) and the map from its stored values to those computed with.
struct ArithmeticOperand {
    ConstView const* view = nullptr;
    double number = 0;
    Int128 whole = 0;         ///< the number, if all is computed in integers
    ExactNumber exact_number; ///< the number, if it is finite
    /// Values from this size on are not what was loaded as double; NaN if all are.
    double inexact_from = std::numeric_limits<double>::quiet_NaN();
    ValueMap map;
};

/// What the kernels need to know.
struct ArithmeticTask {
    ArithmeticOp op = ArithmeticOp::add;
    ArithmeticOperand a, b;
    ValueMap result;          ///< stored result = (value - intercept) / slope
    bool count_zeros = false; ///< integer division
    bool settles = false;     ///< results that would be rounded twice are computed once more
};

VKT_CPU_KERNEL(arithmetic_float, (ArithmeticTask const& task, AnyView out, Losses& counts, Execution const& execution),
               (task, out, counts, execution))
VKT_CPU_KERNEL(arithmetic_double, (ArithmeticTask const& task, AnyView out, Losses& counts, Execution const& execution),
               (task, out, counts, execution))
VKT_CPU_KERNEL(arithmetic_integers,
               (ArithmeticTask const& task, AnyView out, Losses& counts, Execution const& execution),
               (task, out, counts, execution))

} // namespace vkt
