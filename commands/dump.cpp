// vkt dump: see libvkt/operations/statistics/dump.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command dump_command() { return operation_command("dump"); }

} // namespace vkt::shell
