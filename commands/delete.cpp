// vkt delete: a region becomes background.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command delete_command() { return operation_command("delete"); }

} // namespace vkt::shell
