// The completion functions in shell/completion/, built in at configure time.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace vkt::shell {

std::vector<std::pair<std::string, std::string>> completion_scripts();

} // namespace vkt::shell
