// vkt scan: prefix sums.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command scan_command() { return operation_command("scan"); }

} // namespace vkt::shell
