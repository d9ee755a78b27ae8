// Headers with their axes in another order.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <array>

namespace vkt {

/// The axes that remain without one, and it: {0, 2, 1} for y.
std::array<int, 3> axes_without(int axis);
/// A header with its axes in another order: axis k is axis axes[k] of `in`. Voxels keep their world positions.
Header with_axes(Header const& in, std::array<int, 3> const& axes);

} // namespace vkt
