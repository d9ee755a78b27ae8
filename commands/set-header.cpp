// vkt set-header: header edits.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command set_header_command() {
    return operation_command(
        "set", {"Change what the header says about a volume.",
                "Voxels stay as they are. The same as vkt set, in volkit's spelling.",
                {{"Voxel size and unit",
                  "vkt make ramp --dims 8 8 8 | vkt set-header --spacing 0.5,0.5,2 --units HU | vkt info"}}});
}

} // namespace vkt::shell
