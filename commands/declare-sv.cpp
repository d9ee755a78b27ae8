// vkt declare-sv: volkit's empty structured volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command declare_sv_command() {
    return operation_command(
        "declare-sv",
        {"Make a structured volume of zeros.",
         "The range of an integer type stands for 0 to 1 unless --voxel-mapping says otherwise, so that filling with 1 "
         "stores the largest integer.",
         {{"A byte volume to fill", "vkt declare-sv --dims 32 32 32 --data-format uint8 | vkt info"}}});
}

} // namespace vkt::shell
