// Copies that permute the axes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <array>

namespace vkt {

/// Axis k of `out` is axis axes[k] of `in`, reversed where `mirror`, which is about the input's axes, says so. Boxes
/// correspond: in's dims are out's, permuted.
VKT_KERNEL(permute_box, (ConstView in, AnyView out, std::array<int, 3> axes, Mirror mirror, Execution const& execution),
           (in, out, axes, mirror, execution))

} // namespace vkt
