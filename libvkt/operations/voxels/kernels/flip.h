// Mirrored copies of boxes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Copies a box of equal dims, mirrored along one axis.

VKT_KERNEL(flip_box, (ConstView from, AnyView to, Axis axis, Execution const& execution), (from, to, axis, execution))

} // namespace vkt
