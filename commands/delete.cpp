// vkt delete: a region becomes background.
// SPDX-License-Identifier: MIT
#include "shell/command.h"

namespace vkt::shell {

Command delete_command() {
    return operation_command(
        "delete",
        {"Make a region background.",
         "The extent of the volume stays; vkt crop changes it. The background is --value, or what the volume says its "
         "background is, or 0.",
         {{"Without the table under the patient", "vkt delete volume.nrrd --roi :,75%:,: -o patient.nrrd"},
          {"As air", "vkt delete volume.nrrd --roi 0:8,0:8,: --value -1000 --dry-run"}}});
}

} // namespace vkt::shell
