// vkt project: a volume reduced along one axis.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command project_command() {
    return operation_command(
        "project",
        {"Reduce a volume along an axis to one slice: max, min, mean, sum, std or median.",
         "The result has one slice, whose axes are those that are left. NaN is left out. All but the median take one "
         "pass, and memory for the slice alone.",
         {{"A maximum intensity projection, as a picture",
           "vkt project max volume.nrrd --axis y | vkt slice --range minmax -o mip.png"},
          {"The mean of all slices", "vkt project mean volume.nrrd -o mean.nrrd"}}});
}

} // namespace vkt::shell
