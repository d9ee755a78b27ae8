// vkt convert: another data type.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command convert_command() {
    Command command = operation_command("convert");
    command.takes_output = true;
    return command;
}

} // namespace vkt::shell
