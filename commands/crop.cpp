// vkt crop: a box of the volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command crop_command() { return operation_command("crop"); }

} // namespace vkt::shell
