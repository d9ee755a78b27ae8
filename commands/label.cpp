// vkt label: connected components.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command label_command() { return operation_command("label"); }

} // namespace vkt::shell
