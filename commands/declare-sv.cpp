// vkt declare-sv: volkit's empty structured volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command declare_sv_command() { return operation_command("declare-sv"); }

} // namespace vkt::shell
