// vkt threshold: a mask of the values in a range.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command threshold_command() {
    return operation_command(
        "threshold",
        {"Make a mask: 1 where the value lies in a range, 0 elsewhere.",
         "The result is uint8. --above and --below leave out the number itself, --range takes both of its ends. --otsu "
         "finds the threshold that separates the values best and keeps what is above it; --report tells which. Values "
         "are physical; NaN is 0.",
         {{"Bone in a CT", "vkt threshold volume.nrrd --above 100 -o bone.nrrd"},
          {"One label", "vkt threshold volume.nrrd --range 3:3 | vkt stats"},
          {"Foreground, and the threshold that was found",
           "vkt threshold volume.nrrd --otsu --report threshold.json -o mask.nrrd"}}});
}

} // namespace vkt::shell
