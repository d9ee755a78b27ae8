// Arithmetic whose results float or double would round twice: those voxels are computed once more, exactly.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/voxels/arithmetic.h"
#include "libvkt/operations/voxels/exact.h"

#include <limits>

namespace vkt {

/// A volume (null for a number), without a value map.
struct ExactOperand {
    ConstView const* view = nullptr;
    double number = 0;
    ExactNumber exact_number; ///< the number, if it is finite
    /// Values from this size on are not what was loaded as double; NaN if all are.
    double inexact_from = std::numeric_limits<double>::quiet_NaN();
};

VKT_KERNEL(arithmetic_settled,
           (ArithmeticOp op, bool in_float, ExactOperand const& a, ExactOperand const& b, AnyView out, Losses& losses,
            Execution const& execution),
           (op, in_float, a, b, out, losses, execution))

} // namespace vkt
