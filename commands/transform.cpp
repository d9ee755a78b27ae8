// vkt transform: an expression computed for every voxel.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command transform_command() { return operation_command("transform"); }

} // namespace vkt::shell
