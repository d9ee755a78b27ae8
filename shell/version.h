// What `vkt --version` prints.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt::shell {

/// "vkt VERSION", and on lines of their own what the build has and lacks. It loads no library and asks no device:
/// vkt doctor does.
std::string version_text();

} // namespace vkt::shell
