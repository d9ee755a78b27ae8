// vkt refine: a structured volume as a hierarchical one.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command refine_command() { return operation_command("refine"); }

} // namespace vkt::shell
