// vkt stats: see libvkt/operations/statistics/stats.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command stats_command() { return operation_command("stats"); }

} // namespace vkt::shell
