// vkt affine: see libvkt/operations/resample/affine.cpp.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command affine_command() { return operation_command("affine"); }

} // namespace vkt::shell
