// vkt permute: axes in another order.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command permute_command() { return operation_command("permute"); }

} // namespace vkt::shell
