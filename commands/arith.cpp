// vkt arith: arithmetic of volumes and numbers.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command arith_command() { return operation_command("arith"); }

} // namespace vkt::shell
