// What made a volume, as text: a tree, JSON, a pipeline for a shell and what speaks against running it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/history.h"

#include <string>

namespace vkt::shell {

/// The newest step first, what it read indented below it.
std::string history_tree(History const& history);
std::string history_json(History const& history);
/// A line that makes the volume again. Throws Error{failure} if steps are missing: what is left makes no volume.
std::string history_line(History const& history);
/// Why a shell could not run that line here and now; empty if nothing speaks against it.
std::string history_obstacle(History const& history);

} // namespace vkt::shell
