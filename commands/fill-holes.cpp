// vkt fill-holes: zeros that objects enclose.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command fill_holes_command() { return operation_command("fill-holes"); }

} // namespace vkt::shell
