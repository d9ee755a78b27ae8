// vkt flip-range: volkit's name for flip within a region.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command flip_range_command() {
    return operation_command(
        "flip-range",
        {"Mirror the voxels of a region within it.",
         "volkit's name for vkt flip --roi. Voxels outside the region and the geometry stay as they are.",
         {{"Mirror a corner left and right",
           "vkt make ramp --dims 16 12 8 | vkt flip-range --axis x --first 0 0 0 --last 4 4 4 | vkt stats"}}});
}

} // namespace vkt::shell
