// vkt clahe: local contrast.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command clahe_command() { return operation_command("clahe"); }

} // namespace vkt::shell
