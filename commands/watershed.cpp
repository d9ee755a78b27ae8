// vkt watershed: basins.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command watershed_command() { return operation_command("watershed"); }

} // namespace vkt::shell
