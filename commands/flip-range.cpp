// vkt flip-range: volkit's name for flip within a region.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command flip_range_command() { return operation_command("flip-range"); }

} // namespace vkt::shell
