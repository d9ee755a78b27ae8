// vkt rotate: see libvkt/operations/resample/rotate.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command rotate_command() { return operation_command("rotate"); }

} // namespace vkt::shell
