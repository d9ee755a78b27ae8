// vkt reorient: vkt permute under the name that people look for.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command reorient_command() {
    Command command = operation_command(
        "permute",
        {"Turn the axes towards those of the body: vkt permute by another name.",
         "RAS reorders and reverses axes until they point right, anterior and superior as nearly as they can. No voxel "
         "is resampled, spacings and directions move along: voxels keep their world positions.",
         {{"First axis right, second anterior, third superior",
           "vkt set volume.nrrd --attribute space=LPS | vkt reorient --to RAS | vkt info"}}});
    command.takes_output = true;
    return command;
}

} // namespace vkt::shell
