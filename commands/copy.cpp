// vkt copy: a volume pasted into another.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command copy_command() {
    return operation_command(
        "copy",
        {"Paste a volume into another.",
         "The second volume, with the voxels of the first in place of its own. Without --at the part goes where it "
         "lies in the world: back to where vkt crop took it from.",
         {{"A part smoothed, and put back", "vkt crop volume.nrrd --roi 8:24,8:24,: | vkt filter gaussian --sigma 1 | "
                                            "vkt copy - volume.nrrd -o partly.nrrd"},
          {"A label in a corner", "vkt make constant --dims 4 4 4 --dtype uint8 --value 9 -o label.nrrd && vkt read "
                                  "volume.nrrd | vkt copy label.nrrd --at 0,0,0 | vkt stats"}}});
}

} // namespace vkt::shell
