// Which stored value is physically zero: the background of masks and labels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <optional>

namespace vkt {

/// The stored value that the value map sends to 0, if the type has one.
std::optional<double> stored_zero(Header const& header);

} // namespace vkt
