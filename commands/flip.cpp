// vkt flip: voxels in reverse order along an axis.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command flip_command() { return operation_command("flip"); }

} // namespace vkt::shell
