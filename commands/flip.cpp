// vkt flip: voxels in reverse order along an axis.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command flip_command() {
    return operation_command(
        "flip",
        {"Reverse the order of the voxels along an axis.",
         "The direction of the axis is reversed as well, so voxels keep their world positions. With --roi only the "
         "voxels inside the region are mirrored, within it, and the geometry stays.",
         {{"Mirror left and right", "vkt flip x volume.nrrd -o mirrored.nrrd"},
          {"Twice is once too often", "vkt read volume.nrrd | vkt flip z | vkt flip z | vkt diff volume.nrrd -"}}});
}

} // namespace vkt::shell
