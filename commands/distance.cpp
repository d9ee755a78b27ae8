// vkt distance: exact Euclidean distances.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command distance_command() { return operation_command("distance"); }

} // namespace vkt::shell
