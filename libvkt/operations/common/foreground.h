// Cells of hierarchical volumes that count: those that do not hold the background.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <cstddef>
#include <vector>

namespace vkt {

/// The cells of `part` that differ from the background (a stored value), in their order, as one row that begins at
/// (0,0,0) and may be empty. They are kept in `buffer`.
ConstView without_background(ConstView part, double background, std::vector<std::byte>& buffer);

} // namespace vkt
