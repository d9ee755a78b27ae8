// vkt permute: axes in another order.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command permute_command() {
    return operation_command(
        "permute",
        {"Put the axes into another order, or turn them towards those of the body.",
         "zyx makes the input's z the first axis. ras reorders and reverses axes until they point right, anterior and "
         "superior as nearly as they can. Spacings and directions move along: voxels keep their world positions.",
         {{"Slices through what were columns", "vkt permute zyx volume.nrrd -o sagittal.nrrd"},
          {"First axis right, second anterior, third superior",
           "vkt set volume.nrrd --attribute space=LPS | vkt permute --to ras | vkt info"}}});
}

} // namespace vkt::shell
