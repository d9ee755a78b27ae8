// vkt morphology: erosion, dilation, and what is made of them.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command morphology_command() { return operation_command("morphology"); }

} // namespace vkt::shell
