// vkt project: a volume reduced along one axis.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command project_command() { return operation_command("project"); }

} // namespace vkt::shell
