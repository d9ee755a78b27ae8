// Volumes that are hard on methods: by name, small, and the same every time.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"

#include <string>
#include <vector>

namespace vkt::shell {

/// "CONTENT-TYPE": contents of every type, then those that only floats have, odd extents and odd frames.
std::vector<std::string> hard_volume_names();
/// Throws Error{usage} for unknown names.
Volume hard_volume(std::string const& name);

} // namespace vkt::shell
