// vkt filter: filters by name.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command filter_command() {
    Command command;
    command.texts = {"Filter a volume.", "Each filter has options of its own: see vkt filter NAME --help.", {}};
    command.verbs = methods_of("filter");
    return command;
}

} // namespace vkt::shell
