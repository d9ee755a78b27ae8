// vkt threshold: a mask of the values in a range.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command threshold_command() { return operation_command("threshold"); }

} // namespace vkt::shell
