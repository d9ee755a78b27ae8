// vkt dump-range: see libvkt/operations/statistics/dump.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command dump_range_command() { return operation_command("dump-range"); }

} // namespace vkt::shell
