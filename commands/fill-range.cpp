// vkt fill-range: volkit's name for fill with a range.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command fill_range_command() {
    return operation_command(
        "fill-range",
        {"Set the voxels of a region to one value.",
         "volkit's name for vkt fill with a range, which must be given.",
         {{"Blank a corner",
           "vkt make ramp --dims 16 12 8 | vkt fill-range --first 0 0 0 --last 4 4 4 --value 0 | vkt stats"}}});
}

} // namespace vkt::shell
