// vkt refine: a structured volume as a hierarchical one.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command refine_command() {
    return operation_command(
        "refine",
        {"Make a structured volume hierarchical.",
         "Keeps fine blocks only where coarser ones do not reproduce the voxels: what vkt resample makes of the result "
         "at the voxels' centres differs by no more than the tolerance, in values, gradients or what a transfer "
         "function "
         "makes of them. With --tolerance noise that is as much as the noise of the volume explains.",
         {{"Within a hundredth",
           "vkt make sphere --dims 64 48 48 --edge coverage | vkt refine --tolerance 0.01 | vkt info"},
          {"As small as the noise allows", "vkt refine volume.nrrd --tolerance noise --dtype auto | vkt info"},
          {"There and back", "vkt refine volume.nrrd --tolerance 1 | vkt resample --scale 1 | vkt diff volume.nrrd - "
                             "--tolerance 1"}}});
}

} // namespace vkt::shell
