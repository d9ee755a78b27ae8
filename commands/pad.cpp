// vkt pad: voxels added around a volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command pad_command() {
    return operation_command(
        "pad",
        {"Add voxels around a volume.",
         "The origin moves so that voxels keep their world positions. What is added is a value, 0 by default, or "
         "continues the volume: mirror, clamp or wrap.",
         {{"A frame of four voxels", "vkt pad volume.nrrd --by 4 -o framed.nrrd"},
          {"Below and above, mirrored", "vkt pad volume.nrrd --by 0:0,2:3,10:0 --boundary mirror | vkt info"}}});
}

} // namespace vkt::shell
