// vkt copy: a volume pasted into another.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command copy_command() { return operation_command("copy"); }

} // namespace vkt::shell
