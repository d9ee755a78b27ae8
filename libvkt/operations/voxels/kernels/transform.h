// Evaluating an expression's operations over rows of voxels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/voxels/program.h"

#include <span>

namespace vkt {

/// What the kernel needs to know besides the volumes.
struct TransformTask {
    Program const* program = nullptr;
    bool in_float = false; ///< computed in float, else in double
    ProgramPlace place;
    std::span<ValueMap const> maps; ///< of the inputs
    ValueMap result;                ///< stored result = (value - intercept) / slope
    bool counts_undefined = true;   ///< results that are not finite where all voxels are
    std::byte* workspace = nullptr; ///< workspace() for each thread
    std::size_t workspace_bytes = 0;
};

VKT_KERNEL(transform_voxels,
           (TransformTask const& task, std::span<ConstView const> in, AnyView out, TransformLosses& losses,
            Execution const& execution),
           (task, in, out, losses, execution))

} // namespace vkt
