// What operations on several volumes, voxel by voxel, ask of their inputs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <span>

namespace vkt {

/// Throws Error{usage} unless all volumes are of one kind and agree in dims and, seen from one frame, in geometry.
void require_same_grid(std::span<Header const> inputs);

} // namespace vkt
