// vkt slice: a plane of a volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command slice_command() { return operation_command("slice"); }

} // namespace vkt::shell
