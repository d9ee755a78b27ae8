// vkt set: header edits.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command set_command() { return operation_command("set"); }

} // namespace vkt::shell
