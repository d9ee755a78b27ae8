// vkt fill: one value for all voxels, or for a region.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command fill_command() { return operation_command("fill"); }

} // namespace vkt::shell
