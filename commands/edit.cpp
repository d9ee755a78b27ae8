// vkt edit: vkt set under the name that people look for.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command edit_command() {
    Command command = operation_command(
        "set", {"Change what the header says: vkt set by another name.",
                "Voxels stay as they are. For values, vkt arith and vkt transform; for types, vkt convert.",
                {{"Voxel size and unit", "vkt edit volume.nrrd --spacing 0.5,0.5,2 --units HU | vkt info"}}});
    command.takes_output = true;
    return command;
}

} // namespace vkt::shell
