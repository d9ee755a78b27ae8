// What this build and this machine can do, and how fast: lines of a name and what there is to say of it.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/machine/calibration.h"

#include <string>
#include <vector>

namespace vkt::shell {

struct InventoryLine {
    std::string name, value;
};

/// Processor, memory, GPUs (whose copies are timed: some tenths of a second each), formats, libraries.
std::vector<InventoryLine> machine_inventory();
/// The figures of a calibration.
std::vector<InventoryLine> speed_inventory(Calibration const& calibration);

} // namespace vkt::shell
