// What stands at the ends: terminals are refused for voxels, progress is drawn on them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <memory>
#include <string>

namespace vkt::shell {

bool input_is_terminal();
bool output_is_terminal();
bool errors_are_terminal();

/// Draws how far the current volume is read on standard error, after half a second, and wipes it in the end.
std::unique_ptr<Source> with_progress(std::unique_ptr<Source> source, std::string stage);

} // namespace vkt::shell
