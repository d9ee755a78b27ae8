// What operations on several volumes, voxel by voxel, ask of their inputs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <span>
#include <string_view>

namespace vkt {

/// Throws Error{usage} unless all volumes are of one kind and agree in dims and, seen from one frame, in geometry.
void require_same_grid(std::span<Header const> inputs);
/// The same of a volume that an option names, such as "--mask", beside the one that is worked on.
void require_same_grid(Header const& volume, Header const& beside, std::string_view option);

} // namespace vkt
