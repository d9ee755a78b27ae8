// vkt filter: filters by name.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command filter_command() {
    Command command;
    command.texts = {
        "Filter a volume: gaussian.", "Each filter has options of its own: see vkt filter NAME --help.", {}};
    command.verbs.push_back(
        {"gaussian",
         operation_command(
             "filter gaussian",
             {"Smooth with a Gaussian.",
              "A separable convolution whose radius follows from --tolerance: the error against the infinite kernel is "
              "bounded before it runs "
              "(--explain prints the bound). The data type is kept; integers round half to even.",
              {{"A standard deviation of two voxels", "vkt filter gaussian volume.nrrd --sigma 2 -o smooth.nrrd"},
               {"Millimetres instead of voxels, and the plan",
                "vkt filter gaussian volume.nrrd --sigma 1.5 --unit world --explain | vkt stats"}}})});
    return command;
}

} // namespace vkt::shell
