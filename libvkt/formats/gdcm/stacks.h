// DICOM: which slices make a volume, or several in the same places, in which order, and where they lie.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/gdcm/input.h"
#include "libvkt/formats/gdcm/slice.h"
#include "libvkt/formats/parsed_grids.h"

#include <string>
#include <vector>

namespace vkt::dicom {

/// Images that can be slices of one volume, or of several in the same places.
std::vector<std::vector<Slice>> groups(std::vector<Slice> const& all);

/// Of which stack they are, for a list, if they are of one.
std::string stack_text(std::vector<Slice> const& slices);

/// Sorts the slices of a group into volumes, one volume after another, and says in `grids` how many there are, of which
/// dimensions, what tells them apart and where they lie. Throws Error{data} for slices that make no whole volumes, and,
/// unless it is told to force_uniform, for those with gaps, on a slant, or that do not say where they lie.
std::vector<Slice> arrange(Input const& input, std::vector<Slice> slices, bool force_uniform, ParsedGrids& grids);

} // namespace vkt::dicom
