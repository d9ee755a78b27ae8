// vkt pad: voxels added around a volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command pad_command() { return operation_command("pad"); }

} // namespace vkt::shell
