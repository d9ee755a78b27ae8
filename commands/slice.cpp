// vkt slice: a plane of a volume.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command slice_command() {
    return operation_command(
        "slice",
        {"Take a slice of a volume, as a volume or as a picture.",
         "The result has one slice; it keeps its place in the world. As .png or .pgm it is a grey picture, a pixel a "
         "voxel, the first row on top: of uint8 and uint16 as they are, of all types with --range. "
         "As .exr or .pfm it holds the values as floats.",
         {{"A picture of a slice of a CT", "vkt slice volume.nrrd --z 12 --range 0:200 -o slice.png"},
          {"The middle, as values", "vkt slice volume.nrrd --axis x | vkt stats"}}});
}

} // namespace vkt::shell
