// vkt fill-range: volkit's name for fill with a range.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command fill_range_command() { return operation_command("fill-range"); }

} // namespace vkt::shell
