// vkt crop: a box of the volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command crop_command() {
    return operation_command(
        "crop",
        {"Keep an axis-aligned box of the volume.",
         "The box is half-open and given in voxels (--roi), in world units (--roi-world), or by another volume "
         "(--like); voxels keep their world positions. Reading from a raw file touches only the bytes of the box.",
         {{"The central half of every axis", "vkt crop volume.nrrd --roi 25%:75%,25%:75%,25%:75% -o part.nrrd"},
          {"Ten slices from slice 20 on", "vkt crop volume.nrrd --roi :,:,20:+10 | vkt info"}}});
}

} // namespace vkt::shell
