// What NIfTI headers say of another place than the lattice: of a qform that differs, and of the slices as the scanner
// took them. Kept as attributes that are true after every operation, or can be seen not to be.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <optional>
#include <string>

namespace vkt {

/// Attribute: the map from the world of the sform to that of the qform, three rows of four numbers. So it stays true
/// wherever a lattice goes in that world.
inline constexpr char const* qform_map = "sform_to_qform";
/// Attribute: the grid that slice_code and the like are about, its extents, where its axes lead, and its origin.
inline constexpr char const* slice_grid = "slice_grid";

/// The text of the map that takes one lattice to the other.
std::string map_between(Geometry const& from, Geometry const& to);
/// A lattice of the frame right-anterior-superior, as the qform has it. None where the header has no such map, or it
/// makes no lattice of right angles, which a qform cannot say.
std::optional<Geometry> qform_of(Header const& header, Geometry const& lattice);

/// Text of a lattice of the frame right-anterior-superior.
std::string grid_text(Index3 dims, Geometry const& lattice);
/// True if the header says nothing of the grid of its slices, or is still of that grid.
bool has_slice_grid(Header const& header);

/// Axes at right angles, as far as single precision tells.
bool is_orthonormal(Geometry const& g);

/// Takes out what no longer holds, before a NIfTI file is written. Returns what to say of it; empty if nothing was.
std::string drop_outdated(Header& header);

} // namespace vkt
