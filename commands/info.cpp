// vkt info: see libvkt/operations/statistics/info.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command info_command() { return operation_command("info"); }

} // namespace vkt::shell
