// vkt fill: one value for all voxels, or for a region.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command fill_command() {
    return operation_command(
        "fill",
        {"Set all voxels, or those of a region, to one value.",
         "The value is physical: it is mapped to a stored value through the slope and intercept of the volume, rounded "
         "half to even and saturated.",
         {{"An empty volume of the same shape", "vkt fill volume.nrrd --value 0 -o empty.nrrd"},
          {"Blank a corner", "vkt fill volume.nrrd --value 0 --roi 0:8,0:8,0:8 | vkt stats"}}});
}

} // namespace vkt::shell
