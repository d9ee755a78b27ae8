// Arithmetic of up to three operands, voxel by voxel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/wide.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/voxels/arithmetic.h"

#include <array>
#include <span>

namespace vkt {

enum class ArithmeticType : std::uint8_t { in_float, in_double, in_integers };

/// What the kernel needs to know besides the volumes.
struct ArithmeticTask {
    ArithmeticOp op = ArithmeticOp::add;
    ArithmeticType type = ArithmeticType::in_double;
    /// Of each operand which volume it is, or -1 for a number.
    std::array<int, 3> volume{0, -1, -1};
    std::array<double, 3> number{};
    std::array<Int128, 3> whole{};  ///< the numbers, if all is computed in integers
    std::array<ValueMap, 3> map{};  ///< from stored values of the operands to those computed with
    ValueMap result{};              ///< stored result = (value - intercept) / slope
    bool counts_zeros = false;      ///< division among integers: x / 0 is an end of the type
    double lowest = 0, highest = 0; ///< … these, as stored values
};

VKT_KERNEL(arithmetic,
           (ArithmeticTask const& task, std::span<ConstView const> in, AnyView out, Losses& losses,
            Execution const& execution),
           (task, in, out, losses, execution))

} // namespace vkt
