// vkt resample: another number of voxels for the same extent, or another volume's grid.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command resample_command() { return operation_command("resample"); }

} // namespace vkt::shell
