// vkt resample: another number of voxels for the same extent, or another volume's grid.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command resample_command() {
    return operation_command(
        "resample",
        {"Resample a volume to another number of voxels, or onto another's grid.",
         "The volume keeps its extent in the world; voxels are cells, so the outer faces stay where they are. By "
         "default axes that shrink are averaged "
         "by area and axes that grow are interpolated linearly. nearest, linear and area keep the data type; cubic "
         "turns unsigned integers "
         "into floats, because it can leave their range.\n\n"
         "--like puts the volume onto the grid of another, wherever and however turned that lies in the world; what "
         "lies "
         "outside becomes --background.\n\n"
         "Hierarchical (AMR) volumes become structured ones: --cells 50M says how many voxels, --roi which part, in "
         "finest cells; --method basis (default) interpolates across levels, average conserves the integral.",
         {{"Half as many voxels along each axis",
           "vkt make sphere --dims 64 64 48 | vkt resample --scale 0.5 | vkt info"},
          {"Sizes in voxels, cubic",
           "vkt make sphere --dims 32 32 24 | vkt resample --dims 48 48 48 --method cubic | vkt info"},
          {"Onto the grid of another volume, to subtract it",
           "vkt make noise --dims 20 20 20 -o a.vkt && vkt make ramp --dims 30 30 30 --spacing 0.5 | vkt resample "
           "--like "
           "a.vkt | vkt arith sub - a.vkt | vkt stats"},
          {"A grid of about 20 000 voxels from an AMR volume",
           "vkt make amr --blocks 50 --levels 3 | vkt resample --cells 20k | vkt info"},
          {"Cubic voxels from slices",
           "vkt make sphere --dims 32 32 12 --spacing 1,1,2.5 | vkt resample --spacing 1 | vkt info"}}});
}

} // namespace vkt::shell
