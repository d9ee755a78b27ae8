// vkt diff: see libvkt/operations/statistics/diff.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command diff_command() { return operation_command("diff"); }

} // namespace vkt::shell
