// Streams that are damaged on purpose: cut, flipped, with slabs and headers that do not fit together.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {

/// A volume as a stream of one slice a slab, as it travels in a pipe.
std::string stream_of(Volume const& volume);

/// All kinds of damage. A reader must refuse what has any of them.
std::vector<std::string> damage_names();

/// True for damage of voxels alone: a stage that does not look at these may skip them.
bool only_voxels(std::string const& name);

/// The stream of a structured volume with this damage; nothing where it cannot have it (slabs of which there is one).
/// Checksums fit what is wrong, except where they are what is wrong. Throws Error{usage} for unknown names.
std::optional<std::string> damaged(std::string const& stream, std::string const& name);

} // namespace vkt::shell
