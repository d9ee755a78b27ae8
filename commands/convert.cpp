// vkt convert: another data type.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command convert_command() {
    Command command = operation_command(
        "convert",
        {"Change the data type of a volume, or the format of a file.",
         "Values are kept, rounded half to even and clipped to what the type holds. With --range the values in the "
         "range are spread over the "
         "whole type (0 to 1 for floats), and the header's slope and intercept are set so that physical values stay "
         "what they were. What is lost is counted and reported. --dtype auto chooses the smallest type that changes no "
         "physical value by more than --tolerance, if need be with a slope and intercept, after a look at all voxels. "
         "Without --dtype and --range voxels stay as they are.",
         {{"To another format", "vkt convert volume.nrrd volume.mha"},
          {"To floats", "vkt make noise --dims 32 32 32 --dtype uint16 | vkt convert --dtype float32 | vkt stats"},
          {"To bytes, the darkest and brightest per cent clipped",
           "vkt make marschner-lobb --dims 40 40 40 | vkt convert --dtype uint8 --range p1:p99 | vkt stats"},
          {"The smallest type that holds the values within 0.01",
           "vkt make marschner-lobb --dims 40 40 40 | vkt convert --dtype auto --tolerance 0.01 | vkt stats"}}});
    command.takes_output = true;
    return command;
}

} // namespace vkt::shell
