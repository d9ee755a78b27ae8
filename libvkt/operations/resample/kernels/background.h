// Storing floats of which some stand for no value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Values become voxels, rounded half to even and saturated; what is not a number becomes the background, and is
/// counted as undefined.
VKT_KERNEL(store_or_background,
           (ConstView in, AnyView out, double background, Losses& losses, Execution const& execution),
           (in, out, background, losses, execution))

} // namespace vkt
