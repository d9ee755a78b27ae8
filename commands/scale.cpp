// vkt scale: see libvkt/operations/resample/scale.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command scale_command() { return operation_command("scale"); }

} // namespace vkt::shell
